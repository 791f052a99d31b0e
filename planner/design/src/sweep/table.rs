//! Results of sweeps as tables: CSV, and Parquet for what reads columns. The same rows give the same bytes.

use super::Row;
use crate::goal::Quantity;
use parquet::basic::{LogicalType, Repetition, Type as Physical};
use parquet::column::writer::ColumnWriter;
use parquet::data_type::ByteArray;
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::{Type, TypePtr};
use std::sync::Arc;

/// A column with its values.
enum Column {
    Count(Vec<i64>),
    Text(Vec<String>),
    Flag(Vec<bool>),
    Number(Vec<Option<f64>>),
}

/// Columns by name.
fn columns(axes: &[String], rows: &[&Row]) -> Vec<(String, Column)> {
    let text = |of: &dyn Fn(&Row) -> String| Column::Text(rows.iter().map(|row| of(row)).collect());
    let count =
        |of: &dyn Fn(&Row) -> u64| Column::Count(rows.iter().map(|row| of(row) as i64).collect());
    let axis = |k: usize| {
        let labels = || rows.iter().map(|row| &row.labels[k]);
        let numbers: Option<Vec<f64>> = labels().map(|label| label.parse().ok()).collect();
        let column = match numbers {
            Some(numbers) => Column::Number(numbers.into_iter().map(Some).collect()),
            None => Column::Text(labels().cloned().collect()),
        };
        (axes[k].clone(), column)
    };
    let quantity = |(k, of): (usize, Quantity)| {
        let values = rows.iter().map(|row| row.quantities.get(k).copied().flatten());
        (of.bound.to_owned(), Column::Number(values.collect()))
    };
    let mut columns = vec![("point".to_owned(), count(&|row| row.point))];
    columns.extend((0..axes.len()).map(axis));
    columns.push(("motion".to_owned(), text(&|row| row.motion.clone())));
    columns.push(("status".to_owned(), text(&|row| row.status.clone())));
    columns.push(("holds".to_owned(), Column::Flag(rows.iter().map(|row| row.holds).collect())));
    columns.push(("iterations".to_owned(), count(&|row| row.iterations)));
    columns.extend(Quantity::ALL.into_iter().enumerate().map(quantity));
    columns.push(("reason".to_owned(), text(&|row| row.reason.clone())));
    columns
}

/// The rows as CSV.
///
/// # Errors
/// None that memory does not give.
pub fn csv(axes: &[String], rows: &[&Row]) -> Result<Vec<u8>, csv::Error> {
    let columns = columns(axes, rows);
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(columns.iter().map(|(name, _)| name))?;
    for row in 0..rows.len() {
        writer.write_record(columns.iter().map(|(_, column)| match column {
            Column::Count(values) => values[row].to_string(),
            Column::Text(values) => values[row].clone(),
            Column::Flag(values) => values[row].to_string(),
            Column::Number(values) => values[row].map_or(String::new(), |value| value.to_string()),
        }))?;
    }
    writer.flush()?;
    writer.into_inner().map_err(|error| error.into_error().into())
}

/// The rows as Parquet.
///
/// # Errors
/// None that memory does not give.
pub fn parquet(axes: &[String], rows: &[&Row]) -> Result<Vec<u8>, ParquetError> {
    let columns = columns(axes, rows);
    let fields = columns.iter().map(|(name, column)| field(name, column));
    let fields = fields.collect::<Result<Vec<_>, _>>()?;
    let schema = Type::group_type_builder("sweep").with_fields(fields).build()?;
    // The bytes are those of the rows, whoever wrote them.
    let properties = WriterProperties::builder().set_created_by("rollwalk".to_owned()).build();
    let mut bytes = Vec::new();
    let mut file = SerializedFileWriter::new(&mut bytes, Arc::new(schema), Arc::new(properties))?;
    let mut group = file.next_row_group()?;
    for (_, column) in &columns {
        let Some(mut writer) = group.next_column()? else { break };
        write(writer.untyped(), column)?;
        writer.close()?;
    }
    group.close()?;
    file.close()?;
    Ok(bytes)
}

fn field(name: &str, column: &Column) -> Result<TypePtr, ParquetError> {
    let (physical, logical, repetition) = match column {
        Column::Count(_) => (Physical::INT64, None, Repetition::REQUIRED),
        Column::Text(_) => (Physical::BYTE_ARRAY, Some(LogicalType::String), Repetition::REQUIRED),
        Column::Flag(_) => (Physical::BOOLEAN, None, Repetition::REQUIRED),
        Column::Number(_) => (Physical::DOUBLE, None, Repetition::OPTIONAL),
    };
    let builder = Type::primitive_type_builder(name, physical);
    let built = builder.with_repetition(repetition).with_logical_type(logical).build();
    built.map(Arc::new)
}

fn write(writer: &mut ColumnWriter<'_>, column: &Column) -> Result<(), ParquetError> {
    match (writer, column) {
        (ColumnWriter::Int64ColumnWriter(writer), Column::Count(values)) => {
            writer.write_batch(values, None, None)?;
        }
        (ColumnWriter::ByteArrayColumnWriter(writer), Column::Text(values)) => {
            let values: Vec<ByteArray> =
                values.iter().map(|value| ByteArray::from(value.as_str())).collect();
            writer.write_batch(&values, None, None)?;
        }
        (ColumnWriter::BoolColumnWriter(writer), Column::Flag(values)) => {
            writer.write_batch(values, None, None)?;
        }
        (ColumnWriter::DoubleColumnWriter(writer), Column::Number(values)) => {
            let levels: Vec<i16> = values.iter().map(|value| i16::from(value.is_some())).collect();
            let values: Vec<f64> = values.iter().copied().flatten().collect();
            writer.write_batch(&values, Some(&levels), None)?;
        }
        _ => return Err(ParquetError::General("a column of another type".to_owned())),
    }
    Ok(())
}
