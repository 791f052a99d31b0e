//! Columns of panels below a heading.

use super::axes::Panel;
use super::style::{HEADER_HEIGHT, MARGIN, document, heading};

/// Draws columns of panels with their widths, below a heading and a line of facts. Panels have at least the given height.
pub fn page(columns: Vec<(f64, Vec<Panel>)>, least_height: f64, texts: [String; 2]) -> String {
    let most = columns.iter().map(|(_, column)| column.len()).max().unwrap_or(0);
    let body_height = least_height * most as f64;
    let width = columns.iter().map(|(width, _)| width).sum::<f64>() + 2.0 * MARGIN;
    let height = HEADER_HEIGHT + body_height + MARGIN;
    let mut document = document(width, height).add(heading(texts));
    let mut left = MARGIN;
    for (column_width, column) in columns {
        let panel_height = body_height / column.len().max(1) as f64;
        for (r, panel) in column.iter().enumerate() {
            let corner = [left, HEADER_HEIGHT + r as f64 * panel_height];
            let last = r + 1 == column.len();
            document = document.add(panel.draw(corner, [column_width, panel_height], last));
        }
        left += column_width;
    }
    format!("{document}\n")
}
