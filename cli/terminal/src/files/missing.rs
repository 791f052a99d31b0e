//! Advice on a missing file: the name that was probably meant, and the files of the same kind in its folder. Advice on a
//! folder that was given instead of a file.

use super::{FileError, folder};
use crate::kind::Kind;
use crate::{shipped, spelling};
use rollwalk_host::key_file;
use std::ffi::OsStr;
use std::fs::{self, File};
use std::io::Read;
use std::path::{Path, PathBuf};

/// Maximum number of files in the folder of a missing file that are examined.
const NEIGHBOURS_MAX: usize = 1000;
/// Maximum number of files in a message.
const LISTED_MAX: usize = 8;
/// Number of bytes at the start of a file that determine its kind.
const START: u64 = 1 << 16;

/// Error for a missing file, with what to type instead. `named` is the path that another file contains.
pub(super) fn report(path: PathBuf, named: Option<&str>, kind: Kind) -> FileError {
    let typed = named.map_or(path.as_path(), Path::new);
    let is_shipped_folder = shipped::files_in(typed).next().is_some();
    if is_shipped_folder && named.is_none() {
        return given_folder(path, kind);
    }
    let not_shipped = match named {
        Some(named) if kind.is_shipped() && typed.is_relative() => {
            let name = shipped::without_way_up(named);
            format!(", and rollwalk ships none named {}", name.display())
        }
        _ => String::new(),
    };
    FileError::Missing { kind, help: help(&path, typed, kind), path, not_shipped }
}

/// Error for a folder that was given instead of a file, with the files in it that can be given.
pub(super) fn given_folder(path: PathBuf, kind: Kind) -> FileError {
    let help = help_in(&path, kind);
    FileError::NotAFile { kind, path, found: "a folder", help: Some(help) }
}

/// Help for the folder at `path`: its files of a kind, or those of its subfolders, or else the use of its other files.
fn help_in(path: &Path, kind: Kind) -> String {
    let entries = |folder: &Path| {
        let entries = fs::read_dir(folder).into_iter().flatten().take(NEIGHBOURS_MAX);
        let mut paths: Vec<_> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
        paths.sort();
        paths
    };
    let mut files = entries(path);
    let below: Vec<_> = files.iter().filter(|below| below.is_dir()).cloned().collect();
    files.extend(below.iter().flat_map(|below| entries(below)).take(NEIGHBOURS_MAX));
    let on_disk = files.into_iter().filter(|file| file.is_file()).map(|file| {
        let start = start_of(&file);
        (file, start)
    });
    let ships = shipped::files_in(path).map(|(name, text)| (path.join(name), text.to_owned()));
    let files: Vec<_> = if path.is_dir() { on_disk.collect() } else { ships.collect() };
    let has_extension = |file: &Path| {
        let extension = file.extension().unwrap_or_default();
        let extensions = kind.extensions();
        extensions.is_empty() || extensions.iter().any(|known| extension == *known)
    };
    let of_kind = files.iter().filter(|(file, start)| has_extension(file) && is_of(start, kind));
    let named: Vec<_> =
        of_kind.take(LISTED_MAX).map(|(file, _)| file.display().to_string()).collect();
    if let [_, ..] = &named[..] {
        return format!("give one of its files: {}", named.join(", "));
    }
    let other = files.iter().find_map(|(file, start)| Some((file, Kind::of(start)?)));
    let other =
        other.map(|(file, kind)| format!("; it contains {}: {}", file.display(), kind.use_for()));
    format!("the folder contains no {kind}{}; {}", other.unwrap_or_default(), kind.hint())
}

/// File that the user may have meant.
struct Candidate {
    name: String,
    /// Path of a file on the disk, or text of a shipped file.
    content: Result<PathBuf, &'static str>,
}

impl Candidate {
    fn is_of(&self, kind: Kind) -> bool {
        match &self.content {
            Ok(path) => is_of(&start_of(path), kind),
            Err(text) => is_of(text, kind),
        }
    }
}

/// Help for the missing file at `path`, which was typed as `typed`.
fn help(path: &Path, typed: &Path, kind: Kind) -> String {
    let (beside, hint) = (folder(path), kind.hint());
    let fits = |name: &str| fits(path, Path::new(name), kind);
    let on_disk = fs::read_dir(beside).into_iter().flatten().filter_map(|entry| {
        let found = entry.ok()?.path();
        let name = found.file_name()?.to_str()?.to_owned();
        found.is_file().then_some(Candidate { name, content: Ok(found) })
    });
    let ships = shipped::without_way_up(&typed.to_string_lossy());
    let ships = [beside, folder(&ships)].map(shipped::files_in).into_iter().flatten();
    let ships = ships.map(|(name, text)| Candidate { name: name.to_owned(), content: Err(text) });
    let candidates = on_disk.take(NEIGHBOURS_MAX).chain(ships);
    let mut candidates: Vec<_> = candidates.filter(|of| fits(&of.name)).collect();
    // The nearest name is first, because a typing error is most likely.
    let given = path.file_name().unwrap_or_default().to_string_lossy();
    let similarity = |of: &Candidate| strsim::normalized_damerau_levenshtein(&given, &of.name);
    candidates.sort_by(|a, b| a.name.cmp(&b.name));
    candidates.dedup_by(|a, b| a.name == b.name);
    candidates.sort_by(|a, b| similarity(b).total_cmp(&similarity(a)));
    let mut listed: Vec<_> =
        candidates.iter().filter(|of| of.is_of(kind)).take(LISTED_MAX).collect();
    let near = listed.iter().position(|of| slips(path, Path::new(&of.name)).is_some());
    let near = near.map(|index| listed.remove(index));
    let meant = match near {
        Some(near) => Some(typed.with_file_name(&near.name)),
        None => {
            let near = kind.shipped().filter_map(|of| Some((slips(path, of)?, of)));
            let near = near.min_by_key(|(slips, _)| *slips).map(|(_, ships)| ships);
            let of_robot = || shipped::library_of(path).filter(|_| kind == Kind::Library);
            near.or_else(of_robot).map(Path::to_owned)
        }
    };
    let mut text = String::new();
    if let Some(meant) = &meant {
        text += &format!("did you mean `{}`? ", meant.display());
    }
    let place = match beside == Path::new(".") {
        true => "this folder".to_owned(),
        false => beside.display().to_string(),
    };
    for (is_shipped, place, verb) in [(false, &*place, "contains"), (true, "rollwalk", "ships")] {
        let of_place = listed.iter().filter(|of| of.content.is_err() == is_shipped);
        let names: Vec<_> = of_place.map(|of| of.name.as_str()).collect();
        let has_near = near.is_some_and(|near| near.content.is_err() == is_shipped);
        let also = if has_near { "also " } else { "" };
        if !names.is_empty() {
            text += &format!("{place} {also}{verb} {}; ", names.join(", "));
        }
    }
    if listed.is_empty() && meant.is_none() && !beside.exists() {
        text += &format!("the folder {} does not exist either; ", beside.display());
    }
    text + hint
}

/// True if the extension of `found` is that of a missing file. Keys of all kinds share their extensions, and a path without
/// an extension may be any file of a kind that its content shows.
fn fits(missing: &Path, found: &Path, kind: Kind) -> bool {
    let is_key = matches!(kind, Kind::LinkKey | Kind::PrivateKey | Kind::PublicKey);
    let has_any = missing.extension().is_none() && kind.is_recognised();
    is_key || has_any || found.extension() == missing.extension()
}

/// True if a text may be a file of a kind, by its beginning.
fn is_of(start: &str, kind: Kind) -> bool {
    let mark = match kind {
        Kind::LinkKey => key_file::LINK,
        Kind::PrivateKey => "BEGIN PRIVATE KEY",
        Kind::PublicKey => "BEGIN PUBLIC KEY",
        _ => {
            return match Kind::of(start) {
                // Commands that read motions also read problems.
                Some(Kind::Problem) => matches!(kind, Kind::Problem | Kind::Motion),
                Some(found) => found == kind,
                None => !kind.is_recognised(),
            };
        }
    };
    start.contains(mark)
}

fn start_of(path: &Path) -> String {
    let mut start = Vec::new();
    // An unreadable file has no beginning, and is of no kind that can be recognised.
    let _ = File::open(path).and_then(|file| file.take(START).read_to_end(&mut start));
    String::from_utf8_lossy(&start).into_owned()
}

/// Number of wrong letters in the name of a missing file, compared with `found` without extension. `None` if there are too
/// many for a typing error.
fn slips(missing: &Path, found: &Path) -> Option<usize> {
    let part = |of: Option<&OsStr>| of.unwrap_or_default().to_string_lossy().into_owned();
    let known = part(found.file_stem());
    let given = [missing.file_name(), missing.file_stem()].map(part);
    given.iter().filter_map(|given| spelling::slips(given, &known)).min()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::{PathSource, read, read_by, read_text};

    fn help_of(path: &Path, kind: Kind) -> String {
        read(path, kind).unwrap_err().help().unwrap().to_string()
    }

    #[test]
    fn a_missing_file_names_its_neighbours_and_what_to_type() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
        let robot = rollwalk_shipped::text("robots/pup.toml").unwrap();
        write("walk.toml", "name = \"walk\"\n[footfalls]\n");
        write("trot.toml", "name = \"trot\"\n[footfalls]\n");
        write("walk.json", "{}");
        write("kit.toml", robot);
        write("notes.toml", "title = \"notes\"");
        let path = folder.path().join("wlak.toml");
        let report = read(&path, Kind::Motion).unwrap_err();
        assert!(report.to_string().contains("wlak.toml"), "{report}");
        let (here, help) = (folder.path().display(), help_of(&path, Kind::Motion));
        let expected =
            format!("did you mean `{here}/walk.toml`? {here} also contains trot.toml; write a");
        assert!(help.starts_with(&expected), "{help}");
        assert!(help.contains("docs/motion-files.md"), "{help}");
        let help = help_of(&folder.path().join("kti.toml"), Kind::Robot);
        assert!(help.starts_with(&format!("did you mean `{here}/kit.toml`? give ")), "{help}");
        let help = help_of(&folder.path().join("kit"), Kind::Robot);
        assert!(help.starts_with(&format!("did you mean `{here}/kit.toml`? ")), "{help}");
        let help = help_of(&folder.path().join("legs.toml"), Kind::Robot);
        assert!(help.starts_with(&format!("{here} contains kit.toml; ")), "{help}");
    }

    /// The folder of these tests contains none of the shipped files, so the text must come from the program.
    #[test]
    fn the_path_of_a_shipped_file_names_it_where_nothing_else_lies() {
        let text = read_text(Path::new("robots/agilebot.toml"), Kind::Robot).unwrap();
        assert_eq!(Some(&*text), rollwalk_shipped::text("robots/agilebot.toml"));
        let help = help_of(Path::new("robots/agilbot.toml"), Kind::Robot);
        let expected = "did you mean `robots/agilebot.toml`? rollwalk also ships brainbot.toml, ";
        assert!(help.starts_with(expected), "{help}");
        for (name, meant) in [("walk", "walk"), ("trto.toml", "trot"), ("walk.tml", "walk")] {
            let help = help_of(Path::new(name), Kind::Motion);
            let expected = format!("did you mean `motions/{meant}.toml`? write ");
            assert!(help.starts_with(&expected), "{help}");
        }
        // The name of a robot instead of that of its library.
        let help = help_of(Path::new("pup"), Kind::Library);
        assert!(help.starts_with("did you mean `motions/pup_library.toml`? "), "{help}");
    }

    #[test]
    fn a_folder_names_the_files_in_it_that_can_be_given() {
        let folder = tempfile::tempdir().unwrap();
        let here = folder.path().display();
        let help = |kind| help_of(folder.path(), kind);
        let make = "make one with `rollwalk plan MOTION.toml -o PLAN.json`";
        assert_eq!(help(Kind::Plan), format!("the folder contains no plan (JSON); {make}"));
        let write = |name: &str, text: &str| fs::write(folder.path().join(name), text).unwrap();
        write("kit.toml", rollwalk_shipped::text("robots/pup.toml").unwrap());
        let robot = format!("it contains {here}/kit.toml: use a robot file with `rollwalk robot");
        assert!(help(Kind::Plan).contains(&robot), "{}", help(Kind::Plan));
        fs::create_dir(folder.path().join("plans")).unwrap();
        write("plans/walk.json", "{\"format\": \"rollwalk-plan\"}");
        write("plans/kit.rwl", "RWLB");
        for (kind, file) in [
            (Kind::Plan, "plans/walk.json"),
            (Kind::Robot, "kit.toml"),
            (Kind::Packed, "plans/kit.rwl"),
        ] {
            assert_eq!(help(kind), format!("give one of its files: {here}/{file}"));
        }
        // This folder is in the program only.
        let error = read(Path::new("robots"), Kind::Robot).unwrap_err();
        assert!(error.to_string().starts_with("cannot read robots: it is a folder"), "{error}");
        let help = error.help().unwrap().to_string();
        assert!(help.starts_with("give one of its files: robots/"), "{help}");
    }

    /// The disk does not contain the shipped files.
    #[test]
    fn shipped_files_are_not_listed_as_contents_of_a_folder() {
        let folder = tempfile::tempdir().unwrap();
        let robots = folder.path().join("robots");
        fs::create_dir(&robots).unwrap();
        let robot = rollwalk_shipped::text("robots/pup.toml").unwrap();
        fs::write(robots.join("kit.toml"), robot).unwrap();
        let help = help(&robots.join("xyzzy.toml"), Path::new("robots/xyzzy.toml"), Kind::Robot);
        let (on_disk, ships) = help.split_once("; rollwalk ships ").expect(&help);
        assert_eq!(on_disk, format!("{} contains kit.toml", robots.display()));
        assert!(ships.contains(".toml"), "{help}");
    }

    #[test]
    fn a_file_that_another_one_names_is_searched_in_two_places() {
        let error = |named: &str, kind| {
            let path = Path::new("d").join(named);
            read_by(&path, PathSource::InFile { named }, |_| kind).unwrap_err()
        };
        let missing = error("../robots/agilbot.toml", Kind::Robot);
        assert_eq!(
            missing.to_string(),
            "there is no robot file (TOML) at d/../robots/agilbot.toml, and rollwalk ships none \
             named robots/agilbot.toml"
        );
        let help = miette::Diagnostic::help(&missing).unwrap().to_string();
        assert!(help.starts_with("did you mean `../robots/agilebot.toml`? "), "{help}");
        let missing = error("steps.toml", Kind::Terrain);
        assert_eq!(missing.to_string(), "there is no terrain file (TOML) at d/steps.toml");
    }

    /// Keys of all kinds end with `.pem`, but a missing private key must not suggest public keys.
    #[test]
    fn a_missing_key_names_keys_of_its_kind() {
        let folder = tempfile::tempdir().unwrap();
        for (name, text) in [
            ("owner.pem", "-----BEGIN PRIVATE KEY-----"),
            ("owner.pub.pem", "-----BEGIN PUBLIC KEY-----"),
            ("robot.key", key_file::LINK),
            ("notes.txt", "keys"),
        ] {
            fs::write(folder.path().join(name), text).unwrap();
        }
        for (kind, missing, expected) in [
            (Kind::PrivateKey, "onwer.pem", "did you mean `{}/owner.pem`? "),
            (Kind::PublicKey, "owner.pub", "did you mean `{}/owner.pub.pem`? "),
            (Kind::PublicKey, "mine.pem", "{} contains owner.pub.pem; "),
            (Kind::LinkKey, "robot", "did you mean `{}/robot.key`? "),
        ] {
            let help = help_of(&folder.path().join(missing), kind);
            let expected = expected.replace("{}", &folder.path().to_string_lossy());
            assert!(help.starts_with(&expected), "{help}");
            assert!(help.matches("owner").count() < 3, "{help}");
        }
    }
}
