//! Results of sweeps as CSV. Equal rows give equal bytes.

use super::Row;
use crate::goal::Quantity;

/// Writes the rows as CSV, with the column `file` if `has_files` is true.
///
/// # Errors
/// If the CSV writer fails. Writing to memory does not fail.
pub fn csv(axes: &[String], rows: &[&Row], has_files: bool) -> Result<Vec<u8>, csv::Error> {
    let numeric =
        |axis: usize| rows.iter().all(|row: &&Row| row.labels[axis].parse::<f64>().is_ok());
    let numeric: Vec<bool> = (0..axes.len()).map(numeric).collect();
    let mut writer = csv::Writer::from_writer(Vec::new());
    let before = std::iter::once("point").chain(axes.iter().map(String::as_str));
    let fixed = before.chain(["motion", "status", "holds", "iterations"]);
    let after = ["reason"].into_iter().chain(has_files.then_some("file"));
    writer.write_record(fixed.chain(Quantity::ALL.map(|of| of.bound)).chain(after))?;
    for row in rows {
        let label = |(axis, label): (usize, &String)| match label.parse::<f64>() {
            Ok(number) if numeric[axis] => number.to_string(),
            _ => label.clone(),
        };
        let mut fields = vec![row.point.to_string()];
        fields.extend(row.labels.iter().take(axes.len()).enumerate().map(label));
        fields.extend([row.motion.clone(), row.status.clone()]);
        fields.extend([row.holds.to_string(), row.iterations.to_string()]);
        fields.extend((0..Quantity::ALL.len()).map(|k| {
            let value = row.quantities.get(k).copied().flatten();
            value.map_or(String::new(), |value| value.to_string())
        }));
        fields.push(row.reason.clone());
        fields.extend(has_files.then(|| row.file.clone()));
        writer.write_record(&fields)?;
    }
    writer.flush()?;
    writer.into_inner().map_err(|error| error.into_error().into())
}
