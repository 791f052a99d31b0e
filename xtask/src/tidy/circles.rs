//! Check for circular dependencies between the modules of a folder, including the folder's own file.
//!
//! The check reads text: imports, and paths that begin with `crate`, `super`, `self` or a module of the folder. A path through
//! a re-export is attributed to the item's own module. A re-export counts as a use by the folder's file only if the file also
//! names the type elsewhere.

use crate::checkout::TextFile;
use std::collections::{BTreeMap, BTreeSet};

/// Path from the crate's root to a module or an item.
type Path = Vec<String>;
/// Uses of one module of a folder by another, with an example of each.
type Uses = BTreeMap<[String; 2], String>;

/// Folders of the checked crates. In other crates, a folder's own file shares helpers with the files in it.
const CRATES: [&str; 11] = [
    "cli/terminal",
    "control/pilot",
    "control/simulate",
    "firmware",
    "host/bus",
    "host/gamepads",
    "physics",
    "planner",
    "planner/interchange",
    "protocol",
    "robot/multibody",
];

/// Circles in all checked crates, one line for each folder.
pub fn violations(files: &[TextFile]) -> Vec<String> {
    CRATES.iter().flat_map(|folder| of_crate(folder, files)).collect()
}

fn of_crate(folder: &str, files: &[TextFile]) -> Vec<String> {
    let modules = sources(folder, files);
    if modules.is_empty() {
        return vec![format!(
            "{folder}/src: no sources; correct CRATES in xtask/src/tidy/circles.rs"
        )];
    }
    let (mut imports, mut uses, mut named) = (BTreeMap::new(), Vec::new(), BTreeSet::new());
    for (from, code) in &modules {
        for statement in code.split(';') {
            let (mut inline, mut tree, mut line) = (statement, "", "");
            if let Some((before, after)) = statement.rsplit_once("use ") {
                line = before.rsplit('\n').next().unwrap_or_default().trim();
                if line.is_empty() || line.starts_with("pub") {
                    (inline, tree) = (before, after);
                }
            }
            for path in branches(tree).iter().filter_map(|path| absolute(&modules, from, path)) {
                let name = path.last().cloned();
                imports.insert([from, name.as_slice()].concat(), path.clone());
                uses.push((from, path, line.starts_with("pub")));
            }
            for word in inline.split(|c: char| !c.is_alphanumeric() && c != '_' && c != ':') {
                let path = absolute(&modules, from, word).filter(|_| word.contains("::"));
                uses.extend(path.map(|path| (from, path, false)));
                let of_type = |name: &&str| name.starts_with(char::is_uppercase);
                named.extend(word.split(':').filter(of_type).map(|name| (from, name)));
            }
        }
    }
    let mut folders: BTreeMap<Path, Uses> = BTreeMap::new();
    for (from, path, is_public) in uses {
        let to = home(&modules, &imports, path.clone());
        let shared = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
        let item = path.last().map_or("", String::as_str);
        let hands_on = is_public && from.len() == shared && !named.contains(&(from, item));
        if *from != to && !hands_on {
            let ends = [from, &to].map(|end| end.get(shared).cloned().unwrap_or_default());
            let example = format!("{} -> {}", from.join("::"), path.join("::"));
            folders.entry(to[..shared].to_vec()).or_default().insert(ends, example);
        }
    }
    let describe = |(within, uses): (Path, Uses)| {
        let circle = circle(&uses)?.join(", ");
        let within = within.join("/");
        let advice = "move the shared items of two modules into a separate module";
        Some(format!(
            "{folder}/src/{within}: modules use each other in a circle ({circle}); \
            {advice}"
        ))
    };
    folders.into_iter().filter_map(describe).collect()
}

/// Code of each module without tests and comments.
fn sources(folder: &str, files: &[TextFile]) -> BTreeMap<Path, String> {
    let (mut sources, mut tests) = (BTreeMap::new(), Vec::new());
    for TextFile { path, text } in files {
        let path = path.strip_prefix(folder).and_then(|path| path.strip_prefix("/src/"));
        let Some(path) = path.and_then(|path| path.strip_suffix(".rs")) else { continue };
        let mut module: Path = path.split('/').map(str::to_owned).collect();
        module.pop_if(|name| ["lib", "main", "mod"].contains(&name.as_str()));
        let text = text.split("#[cfg(test)]\nmod tests {").next().unwrap_or_default();
        let lines = text.lines().map(|line| line.split("//").next().unwrap_or_default());
        let code = lines.map(without_reach).collect::<Vec<_>>().join("\n");
        let declared = code.split("#[cfg(test)]\nmod ").skip(1).filter_map(|of| of.split_once(';'));
        tests.extend(declared.map(|(name, _)| [&module[..], &[name.to_owned()]].concat()));
        sources.insert(module, code);
    }
    let is_test = |module: &Path| tests.iter().any(|test| module.starts_with(test));
    sources.retain(|module, _| !is_test(module) && module.iter().all(|name| name != "tests"));
    sources
}

/// Removes the path in `pub(in path)`, which is not a use.
fn without_reach(line: &str) -> String {
    let reach = line.split_once("pub(in ").and_then(|(head, rest)| {
        let (_, item) = rest.split_once(") ")?;
        Some(format!("{head}pub {item}"))
    });
    reach.unwrap_or_else(|| line.to_owned())
}

/// Paths of an import, one for each branch of its braces.
fn branches(tree: &str) -> Vec<String> {
    let Some((head, rest)) = tree.split_once('{') else {
        let path = tree.split(" as ").next().unwrap_or_default().trim();
        return if path.is_empty() { Vec::new() } else { vec![path.to_owned()] };
    };
    let mut depth = 0;
    let parts = rest.rsplit_once('}').map_or(rest, |(inside, _)| inside).split(|c| {
        depth += i32::from(c == '{') - i32::from(c == '}');
        c == ',' && depth == 0
    });
    parts.flat_map(branches).map(|path| head.trim().to_owned() + &path).collect()
}

/// Converts a path within the crate to one from its root; returns `None` for other paths.
fn absolute(modules: &BTreeMap<Path, String>, from: &Path, path: &str) -> Option<Path> {
    let first = path.split("::").next()?;
    let child = [&from[..], &[first.to_owned()]].concat();
    let is_own = ["crate", "super", "self"].contains(&first) || modules.contains_key(&child);
    let step = |mut names: Path, name| {
        match name {
            "crate" => names.clear(),
            "super" => drop(names.pop()),
            "self" | "*" | "" => {}
            _ => names.push(name.to_owned()),
        }
        names
    };
    is_own.then(|| path.split("::").fold(from.clone(), step))
}

/// Returns the module that defines the item of a path, following imports.
fn home(modules: &BTreeMap<Path, String>, imports: &BTreeMap<Path, Path>, mut path: Path) -> Path {
    for _ in 0..8 {
        let is_module = |&depth: &usize| modules.contains_key(&path[..depth]);
        let depth = (0..=path.len()).rev().find(is_module).unwrap_or(0);
        match path.get(..=depth).and_then(|item| imports.get(item)) {
            Some(item) => path = [item, &path[depth + 1..]].concat(),
            None => return path[..depth].to_vec(),
        }
    }
    path
}

/// Returns a circle of uses; `None` if there is none.
fn circle(uses: &Uses) -> Option<Vec<&str>> {
    let mut left: Vec<_> = uses.iter().collect();
    let ends = |left: &[(&[String; 2], _)], to| !left.iter().any(|([from, _], _)| from == to);
    while let Some(end) = left.iter().position(|([_, to], _)| ends(&left, to)) {
        left.remove(end);
    }
    let mut walk = vec![*left.first()?];
    loop {
        let ([_, to], _) = walk.last()?;
        if let Some(begin) = walk.iter().position(|([from, _], _)| from == to) {
            return Some(walk[begin..].iter().map(|(_, example)| example.as_str()).collect());
        }
        walk.push(*left.iter().find(|([from, _], _)| from == to)?);
    }
}

#[cfg(test)]
mod tests {
    use crate::checkout::file;

    #[test]
    fn circles_are_found_behind_re_exports_and_in_folders() {
        let tests = "#[cfg(test)]\nmod tests {\n    use crate::a::A;\n}\n";
        let mut files = [
            file("physics/src/lib.rs", "pub mod a;\nmod b;\nmod c;\npub use a::A;\n"),
            file("physics/src/a.rs", "use super::{c::C as D,\n    b::{self, B},\n};\n"),
            file("physics/src/b.rs", &format!("// crate::a::A\nuse std::fmt;\n{tests}")),
            file("physics/src/c/mod.rs", "#[cfg(test)]\nmod d;\nfn f() {\n    e::g(1)\n}\n"),
            file("physics/src/c/d.rs", "use crate::a::A;\n"),
            file("physics/src/c/e.rs", "pub fn g(_: u8) -> crate::b::B {}\n"),
        ];
        assert_eq!(super::of_crate("physics", &files), [""; 0]);

        files[2].text = "use crate::A;\n".to_owned() + &files[2].text;
        files[5].text += "use super::f;\n";
        let advice = "move the shared items of two modules into a separate module";
        let expected = [
            format!(
                "physics/src/: modules use each other in a circle (a -> b::B, b -> A); {advice}"
            ),
            format!(
                "physics/src/c: modules use each other in a circle (c -> c::e::g, c::e -> c::f); {advice}"
            ),
        ];
        assert_eq!(super::of_crate("physics", &files), expected);
        assert_eq!(super::of_crate("robot", &files).len(), 1);
    }
}
