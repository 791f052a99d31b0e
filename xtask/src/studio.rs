//! `cargo xtask studio`: builds the studio's engine as WebAssembly, the page with it, and a single file with everything.
//!
//! The page itself is built by `studio/web/build.mjs` and committed in `studio/dist/`, so that Node is not needed here.

use crate::{bare_metal, shell};
use data_encoding::BASE64;
use std::fs;
use std::path::{Path, PathBuf};

const TARGET: &str = "wasm32-unknown-unknown";
/// Files of the page in a site; the HTML is first.
const PAGE: [&str; 5] = ["index.html", "studio.css", "three.js", "studio.js", "LICENSES.txt"];

/// Builds engine, site and single file into `studio` of the target folder.
///
/// # Errors
/// Returns an error if the build fails, or if a file cannot be read or written. If the target is missing, the error contains
/// the command that installs it.
pub fn build() -> Result<(), String> {
    let wasm = engine()?;
    let folder = shell::target_folder().join("studio");
    let site = folder.join("site");
    let failed = |path: &Path, error: std::io::Error| format!("{}: {error}", path.display());
    fs::create_dir_all(&site).map_err(|error| failed(&site, error))?;
    let write = |path: &Path, bytes: &[u8]| {
        fs::write(path, bytes).map_err(|error| failed(path, error))?;
        println!("{} {} KB", path.display(), bytes.len() / 1000);
        Ok::<_, String>(())
    };
    let read = |path: PathBuf| fs::read(&path).map_err(|error| failed(&path, error));
    let engine = read(wasm)?;
    write(&folder.join("studio.wasm"), &engine)?;
    write(&site.join("studio.wasm"), &engine)?;
    let dist = shell::workspace_root().join("studio/dist");
    for name in PAGE {
        write(&site.join(name), &read(dist.join(name))?)?;
    }
    let text = |name: &str| {
        let bytes = read(dist.join(name))?;
        String::from_utf8(bytes).map_err(|_| format!("studio/dist/{name} is not UTF-8 text"))
    };
    let page = one_file(&text("index.html")?, &text, &engine)?;
    write(&folder.join("studio.html"), page.as_bytes())
}

/// Builds the engine and returns its path.
///
/// # Errors
/// Returns the errors of [`build`].
pub fn engine() -> Result<PathBuf, String> {
    bare_metal::need_target(TARGET)?;
    let mut cargo = shell::cargo(&["rustc", "--package", "rollwalk-studio", "--lib"]);
    cargo.args(["--crate-type", "cdylib", "--target", TARGET, "--profile", "page"]);
    shell::run(&mut cargo)?;
    Ok(shell::target_folder().join(TARGET).join("page/rollwalk_studio.wasm"))
}

/// Returns the page with style, scripts and engine inside. The content security policy is left out, because a file from disk
/// has no origin and its inline scripts have no address.
fn one_file(
    page: &str,
    text: &dyn Fn(&str) -> Result<String, String>,
    engine: &[u8],
) -> Result<String, String> {
    let mut one = String::new();
    let mut scripts = 0;
    for line in page.lines() {
        if line.contains("http-equiv=\"Content-Security-Policy\"") {
            continue;
        }
        if line == "<link rel=\"stylesheet\" href=\"studio.css\">" {
            one += &format!("<style>\n{}\n</style>\n", text("studio.css")?);
            continue;
        }
        let script =
            line.strip_prefix("<script src=\"").and_then(|rest| rest.strip_suffix("\"></script>"));
        let Some(name) = script else {
            one += line;
            one.push('\n');
            continue;
        };
        if scripts == 0 {
            let base64 = BASE64.encode(engine);
            one += &format!(
                "<script type=\"application/wasm;base64\" id=\"studio-wasm\">{base64}</script>\n"
            );
        }
        scripts += 1;
        // A script ends at the first end tag, even inside a string.
        let script = text(name)?.replace("</script", "<\\/script");
        one += &format!("<script>\n{script}\n</script>\n");
    }
    match scripts {
        2 => Ok(one),
        _ => Err(format!(
            "studio/dist/index.html has {scripts} scripts on separate lines; expected 2"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_page_becomes_one_file() {
        let page = fs::read_to_string(shell::workspace_root().join("studio/dist/index.html"));
        let text = |name: &str| Ok(format!("/* {name} </script> */"));
        let one = one_file(&page.unwrap(), &text, &[0, 97, 115, 109]).unwrap();
        for part in [
            "<style>\n/* studio.css",
            "id=\"studio-wasm\">AGFzbQ==</script>",
            "<script>\n/* three.js <\\/script> */\n</script>\n<script>\n/* studio.js",
        ] {
            assert!(one.contains(part), "{part} is not in {one}");
        }
        assert!(!one.contains("src=") && !one.contains("http-equiv=\"Content"), "{one}");
    }
}
