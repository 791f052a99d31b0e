//! Colours, fonts, margins and page frame of all pictures.

use svg::Document;
use svg::node::element::{Group, Rectangle, Style, Text};

/// Colours that colour-blind readers can distinguish (Okabe and Ito), and a dark grey.
pub const COLORS: [&str; 7] =
    ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#333333"];
pub const INK: &str = "#1f2933";
pub const FAINT: &str = "#7b8794";
/// Colours of shapes and lines, each with the colour that replaces it if the viewer prefers a dark theme. Colours that are
/// missing here are readable on both pages.
const DARK: [[&str; 2]; 13] = [
    ["white", "#0d1117"],
    [INK, "#e6edf3"],
    [FAINT, "#9aa5b1"],
    [COLORS[0], "#3f8fd2"],
    [COLORS[6], "#d0d7de"],
    ["#f5f7fa", "#161b22"],
    ["#eef2f6", "#21262d"],
    ["#e4e7eb", "#30363d"],
    ["#d9e2ec", "#3d444d"],
    ["#cbd2d9", "#484f58"],
    ["#9aa5b1", "#7d8590"],
    ["#8fb4d9", "#2f5b8a"],
    ["#e1e1e1", "#30363d"],
];
pub const FONT: &str = "Inter, 'Helvetica Neue', Helvetica, Arial, 'DejaVu Sans', sans-serif";

pub const HEADER_HEIGHT: f64 = 64.0;
pub const MARGIN: f64 = 20.0;

/// Creates an empty page: white, or dark if the viewer prefers a dark theme.
pub fn document(width: f64, height: f64) -> Document {
    Document::new()
        .set("viewBox", (0.0, 0.0, width, height))
        .set("width", width)
        .set("height", height)
        .set("font-family", FONT)
        .set("font-size", 11)
        .add(Style::new(dark_style()))
        .add(Rectangle::new().set("width", width).set("height", height).set("fill", "white"))
}

/// Returns the CSS that replaces colours. Its quotes are single, so that a search for the attribute of a shape does not find it.
fn dark_style() -> String {
    let rules = DARK.map(|[light, dark]| {
        format!("[fill='{light}']{{fill:{dark}}}[stroke='{light}']{{stroke:{dark}}}")
    });
    format!("@media(prefers-color-scheme:dark){{{}}}", rules.concat())
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::motion::ContactMargins;
    use crate::plot::{AnimationParts, JointPanels, animation, figure, robot, strip};
    use crate::test_plans;
    use rollwalk_multibody::ground::file::from_toml;

    /// Relative luminance of a colour such as `#0d1117` (WCAG 2).
    fn luminance(color: &str) -> f64 {
        let linear = |k: usize| {
            let value = u8::from_str_radix(&color[k..k + 2], 16).expect("hexadecimal digits");
            let part = f64::from(value) / 255.0;
            if part <= 0.04045 { part / 12.92 } else { ((part + 0.055) / 1.055).powf(2.4) }
        };
        0.2126 * linear(1) + 0.7152 * linear(3) + 0.0722 * linear(5)
    }

    fn on_dark(color: &str) -> &str {
        DARK.iter().find(|[light, _]| *light == color).map_or(color, |[_, dark]| *dark)
    }

    #[test]
    fn curves_and_texts_are_readable_on_a_dark_page() {
        let page = luminance(on_dark("white"));
        let contrast = |color: &str| (luminance(on_dark(color)) + 0.05) / (page + 0.05);
        for color in COLORS {
            assert!(contrast(color) >= 3.0, "{color}: {}", contrast(color));
        }
        for color in [INK, FAINT] {
            assert!(contrast(color) >= 4.5, "{color}: {}", contrast(color));
        }
    }

    #[test]
    fn every_drawn_colour_has_a_place_in_both_themes() {
        let plan = test_plans::cruise();
        let mut on_stairs = plan.clone();
        let stairs = "[stairs]\nat_x_m = 0.1\ncount = 2\nriser_m = 0.02\ntread_m = 0.1";
        let stairs = from_toml("stairs.toml", stairs).expect("stairs");
        let margins = ContactMargins::of(&plan.robot);
        on_stairs.motion.set_terrain(stairs, margins, &plan.robot);
        let pictures = [
            figure(&plan, JointPanels::Limb),
            strip(&[&plan], 3),
            animation(&plan, AnimationParts { forces: true, footfalls: true }),
            animation(&on_stairs, AnimationParts::default()),
            robot(&plan.robot).expect("it stands"),
        ];
        for picture in &pictures {
            assert!(picture.contains("prefers-color-scheme:dark"));
            for attribute in ["fill=\"", "stroke=\""] {
                for rest in picture.split(attribute).skip(1) {
                    let color = rest.split('"').next().unwrap_or_default();
                    let is_known = DARK.iter().any(|[light, _]| *light == color);
                    assert!(is_known || COLORS.contains(&color) || color == "none", "{color}");
                }
            }
            for text in picture.split("<text").skip(1) {
                let tag = text.split('>').next().unwrap_or_default();
                assert!(tag.contains("fill="), "black on dark: {tag}");
            }
        }
    }
}
