//! Check of the links between documents: each leads to a file of the checkout and, behind `#`, to one of its headings, and
//! follows its text (`[text](path)`).

use crate::checkout::TextFile;
use crate::markdown::{Page, target};
use std::collections::{BTreeMap, BTreeSet};

/// Returns the dead links, and the number of valid ones.
pub fn violations(files: &[TextFile], exists: impl Fn(&str) -> bool) -> (Vec<String>, usize) {
    let documents = files.iter().filter(|file| file.path.ends_with(".md"));
    let pages: BTreeMap<&str, Page> =
        documents.map(|file| (file.path.as_str(), Page::parse(&file.text))).collect();
    let anchors = |path: &str| -> Option<BTreeSet<&str>> {
        Some(pages.get(path)?.headings.iter().map(|heading| heading.anchor.as_str()).collect())
    };
    let (mut found, mut checked) = (Vec::new(), 0);
    for (path, page) in &pages {
        for link in &page.links {
            // The network is not used, because foreign pages change without our changes.
            let Some((to, anchor)) = target(path, &link.to) else { continue };
            checked += 1;
            let place = format!("{path}:{}: the link to `{}`", link.line, link.to);
            if !exists(&to) {
                found.push(format!("{place} leads to no file; there is no `{to}`"));
            } else if link.place.is_none() {
                found.push(format!("{place} must follow its text, as in [text](path)"));
            } else if !anchor.is_empty() && !anchors(&to).is_some_and(|all| all.contains(&*anchor))
            {
                let all: Vec<_> = anchors(&to).into_iter().flatten().collect();
                let shares_a_word = |one: &str| one.split('-').any(|word| anchor.contains(word));
                let near: Vec<_> = all.iter().filter(|one| shares_a_word(one)).copied().collect();
                let near = if near.is_empty() { all } else { near };
                found.push(format!(
                    "{place} names a heading that `{to}` lacks; headings there: {}",
                    near.join(", ")
                ));
            }
        }
    }
    (found, checked)
}

#[cfg(test)]
mod tests {
    use crate::checkout::file;

    #[test]
    fn links_to_nothing_are_named() {
        let readme = "[a](docs/a.md#one) [b](docs/gone.md) [c](docs/a.md#two) [d](#top) ![i](i.svg)\n\
                      [e](https://example.org/gone) [f][f]\n\n# Top\n\n[f]: docs/a.md\n";
        let files = [file("README.md", readme), file("docs/a.md", "# One\n"), file("i.svg", "")];
        let (found, checked) =
            super::violations(&files, |path| files.iter().any(|file| file.path == path));
        assert_eq!(checked, 6);
        assert_eq!(found.len(), 3, "{found:#?}");
        assert!(found[0].starts_with("README.md:1: the link to `docs/gone.md` leads to no file"));
        assert!(found[1].contains("`docs/a.md#two` names a heading") && found[1].contains("one"));
        assert!(found[2].starts_with("README.md:2") && found[2].contains("must follow its text"));
    }
}
