//! Colours, fonts, margins and page frame of all pictures.

use svg::Document;
use svg::node::element::{Group, Rectangle, Text};

/// Colours that colour-blind readers can distinguish (Okabe and Ito), and a dark grey.
pub const COLORS: [&str; 7] =
    ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#333333"];
pub const INK: &str = "#1f2933";
pub const FAINT: &str = "#7b8794";
pub const FONT: &str = "Inter, 'Helvetica Neue', Helvetica, Arial, 'DejaVu Sans', sans-serif";

pub const HEADER_HEIGHT: f64 = 64.0;
pub const MARGIN: f64 = 20.0;

/// Creates an empty white page.
pub fn document(width: f64, height: f64) -> Document {
    Document::new()
        .set("viewBox", (0.0, 0.0, width, height))
        .set("width", width)
        .set("height", height)
        .set("font-family", FONT)
        .set("font-size", 11)
        .add(Rectangle::new().set("width", width).set("height", height).set("fill", "white"))
}

pub fn heading([heading, facts]: [String; 2]) -> Group {
    let text = |content: String, y: f64| Text::new(content).set("x", MARGIN + 10.0).set("y", y);
    Group::new()
        .add(text(heading, 32.0).set("font-size", 20).set("font-weight", 600).set("fill", INK))
        .add(text(facts, 52.0).set("font-size", 12).set("fill", FAINT))
}

/// Rounds a coordinate to a hundredth of a pixel.
pub fn px(value: f64) -> f64 {
    (value * 100.0).round() / 100.0
}
