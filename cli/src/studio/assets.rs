//! Page of the studio, embedded in the program: the files of `studio/dist/`.

use rollwalk_bus::name::BusName;

/// File of the page, with its media type.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Asset<'a> {
    pub kind: &'static str,
    pub bytes: &'a [u8],
}

/// Declares the files by name, with their media types.
macro_rules! assets {
    ($($name:literal: $kind:literal),* $(,)?) => {
        const FILES: &[(&str, Asset<'static>)] = &[$((
            $name,
            Asset {
                kind: $kind,
                bytes: include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/../studio/dist/", $name)),
            },
        )),*];
    };
}

assets! {
    "studio.css": "text/css; charset=utf-8",
    "studio.js": "text/javascript; charset=utf-8",
    "three.js": "text/javascript; charset=utf-8",
    "LICENSES.txt": "text/plain; charset=utf-8",
}

const PAGE: &str = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../studio/dist/index.html"));
/// First element of the page's head; the elements that describe the engine are inserted after it.
const CHARSET: &str = "<meta charset=\"utf-8\">";

/// File of the page with the given name.
pub fn file(name: &str) -> Option<Asset<'static>> {
    FILES.iter().find(|(known, _)| *known == name).map(|(_, asset)| *asset)
}

/// HTML of the page. Inserted elements in its head select this program as the engine, with the token and the permitted bus. The
/// content security policy is a header of the response instead, because it contains this port.
pub fn page(token: &str, bus: Option<&BusName>) -> String {
    let lines =
        PAGE.lines().filter(|line| !line.contains("http-equiv=\"Content-Security-Policy\""));
    let page: String = lines.flat_map(|line| [line, "\n"]).collect();
    let mut told = format!(
        "{CHARSET}\n<meta name=\"engine\" content=\"websocket\">\n<meta name=\"token\" content=\"{token}\">"
    );
    if let Some(bus) = bus {
        // The name of a device may contain any character.
        let bus = bus.to_string().replace('&', "&amp;").replace('"', "&quot;").replace('<', "&lt;");
        told += &format!("\n<meta name=\"relay\" content=\"{bus}\">");
    }
    page.replacen(CHARSET, &told, 1)
}
