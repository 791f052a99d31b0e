//! Link check of the built site: each link leads to a file of the site and, behind `#`, to an element with that id.

use crate::markdown::target;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

/// Folder of rustdoc's pages in the site, which rustdoc checks itself.
pub const RUSTDOC: &str = "rustdoc";

/// mdBook's page for unknown addresses; its links are relative to the root of a server.
const NOT_FOUND: &str = "404.html";

/// Checks all links of the pages in some folders of the site; returns their number.
///
/// # Errors
/// Returns the dead links with their pages.
pub fn check(site: &Path, folders: &[&str]) -> Result<usize, String> {
    let mut pages = BTreeMap::new();
    for folder in folders {
        let path = site.join(folder);
        let entries =
            fs::read_dir(&path).map_err(|error| format!("{}: {error}", path.display()))?;
        for entry in entries {
            let path = entry.map_err(|error| error.to_string())?.path();
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            if name.ends_with(".html") && name != NOT_FOUND {
                let text =
                    fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))?;
                pages.insert(format!("{folder}{name}"), text);
            }
        }
    }
    let (faults, checked) = faults(&pages, |path| site.join(path).exists());
    if faults.is_empty() { Ok(checked) } else { Err(faults.join("\n")) }
}

/// Returns the dead links, and the number of valid ones.
fn faults(pages: &BTreeMap<String, String>, exists: impl Fn(&str) -> bool) -> (Vec<String>, usize) {
    let ids: BTreeMap<&str, BTreeSet<&str>> =
        pages.iter().map(|(name, text)| (name.as_str(), values(text, "id").collect())).collect();
    let (mut faults, mut checked) = (Vec::new(), 0);
    for (name, text) in pages {
        for to in values(text, "href").chain(values(text, "src")) {
            let Some((path, anchor)) = target(name, to) else { continue };
            checked += 1;
            let has = |ids: &BTreeSet<&str>| anchor.is_empty() || ids.contains(&*anchor);
            if !exists(&path) || !ids.get(&*path).is_none_or(has) {
                faults.push(format!("{name}: `{to}` leads nowhere"));
            }
        }
    }
    (faults, checked)
}

/// Values of an attribute in mdBook's HTML, which writes them in double quotes.
fn values<'a>(html: &'a str, attribute: &str) -> impl Iterator<Item = &'a str> {
    let opening = format!(" {attribute}=\"");
    let parts: Vec<_> = html.split(&*opening).skip(1).collect();
    parts.into_iter().filter_map(|rest| Some(rest.split_once('"')?.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn links_to_no_file_and_to_no_id_are_named() {
        let page = |text: &str| text.to_owned();
        let pages = BTreeMap::from([
            (
                "a.html".to_owned(),
                page(r##"<a href="b.html#x">, <a href="b.html#y">, <a href="#z">"##),
            ),
            (
                "b.html".to_owned(),
                page(r#"<h2 id="x"><img src="gone.svg"><a href="https://x.org">"#),
            ),
        ]);
        let (faults, checked) = faults(&pages, |path| pages.contains_key(path));
        assert_eq!(checked, 4);
        assert_eq!(
            faults,
            [
                "a.html: `b.html#y` leads nowhere",
                "a.html: `#z` leads nowhere",
                "b.html: `gone.svg` leads nowhere"
            ]
        );
    }
}
