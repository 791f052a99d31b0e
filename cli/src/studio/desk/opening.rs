//! Opens the files of the command line and the files that they name, and selects those that the page shows first.

use miette::{Report, miette};
use rollwalk_terminal::files::{self, PathSource};
use rollwalk_terminal::inputs::resolve_relative;
use rollwalk_terminal::kind::Kind;
use serde::Serialize;
use serde_json::Value;
use std::collections::{HashSet, VecDeque};
use std::fs;
use std::path::{Path, PathBuf};
use toml_edit::{Document, Item, TableLike};

/// Maximum number of open files, including those that other files name.
const FILES_MAX: usize = 200;
/// Maximum number of files that are examined; an untrusted library may name any number of files.
const SEEN_MAX: usize = 2 * FILES_MAX;
/// Maximum number of files of a folder that an error lists.
const LISTED: usize = 4;
/// First bytes of a packed library.
const PACKED: &[u8] = b"ROLLWALK";

/// File as it was most recently read or written.
pub struct Sheet {
    /// Name in the page: the path, with `/` between folders.
    pub name: String,
    pub path: PathBuf,
    pub text: String,
    /// True if the user named this file, or if it is in the folder of a file that the user named, or below.
    pub is_users: bool,
}

/// Files that the page shows first, by name.
#[derive(Debug, Default, Serialize)]
pub struct InitialFiles {
    pub motion: Option<String>,
    pub library: Option<String>,
    /// Robot that moves, even if the motion file names another robot.
    pub robot: Option<String>,
    /// Path of `robot` relative to the motion file, if that names another robot.
    pub robot_in_motion: Option<String>,
    /// Plan from which the motion is planned.
    pub plan: Option<String>,
    /// URDF from which a robot is created.
    pub urdf: Option<String>,
    /// Side file of the URDF.
    pub side: Option<String>,
}

/// Reads the files that the user named, and the documents that they name.
///
/// # Errors
/// Returns an error if a file that the user named cannot be read, or is of a kind that the studio does not open, or if the motion
/// of a plan is not found.
pub fn open(paths: &[PathBuf]) -> miette::Result<(Vec<Sheet>, InitialFiles)> {
    let folders: Vec<_> = paths.iter().filter_map(|path| folder_of(path)).collect();
    let (mut sheets, mut desired) = (Vec::<Sheet>::new(), InitialFiles::default());
    let (mut robots, mut named) = (Vec::new(), VecDeque::new());
    for path in paths {
        let name = name_of(path);
        if sheets.iter().any(|sheet| sheet.name == name) {
            continue;
        }
        let text = text_of(path)?;
        let mentions = FileReferences::of(&text);
        let role = role(path, &text, &mentions, paths)?;
        match role {
            Role::Robot => robots.push(name.clone()),
            Role::Design => {
                robots.extend(
                    mentions.robot.iter().map(|robot| name_of(&resolve_relative(path, robot))),
                );
            }
            Role::Other => {}
            _ => {
                let slot = match role {
                    Role::Motion => &mut desired.motion,
                    Role::Library => &mut desired.library,
                    Role::Plan => &mut desired.plan,
                    Role::Urdf => &mut desired.urdf,
                    _ => &mut desired.side,
                };
                slot.get_or_insert_with(|| name.clone());
            }
        }
        named.extend(mentions.all().map(|file| resolve_relative(path, file)));
        sheets.push(Sheet { name, path: path.clone(), text, is_users: true });
    }
    let mut seen: HashSet<String> = sheets.iter().map(|sheet| sheet.name.clone()).collect();
    let mut follow = |named: &mut VecDeque<PathBuf>, sheets: &mut Vec<Sheet>| {
        while let Some(path) = named.pop_front()
            && sheets.len() < FILES_MAX
            && seen.len() < SEEN_MAX
        {
            if let Some(sheet) = seen.insert(name_of(&path)).then(|| mentioned(&path, &folders)) {
                let Some(sheet) = sheet else { continue };
                let mentions = FileReferences::of(&sheet.text);
                named.extend(mentions.all().map(|file| resolve_relative(&path, file)));
                sheets.push(sheet);
            }
        }
    };
    follow(&mut named, &mut sheets);
    let is_plan = |sheet: &&Sheet| desired.plan.as_ref() == Some(&sheet.name);
    if desired.motion.is_none()
        && let Some(plan) = sheets.iter().find(is_plan)
    {
        let motion = motion_of(plan, &sheets)?;
        desired.motion = Some(motion.clone());
        named.push_back(motion.into());
        follow(&mut named, &mut sheets);
    }
    let is_motion = |sheet: &&Sheet| FileReferences::of(&sheet.text).is_motion;
    let first = || sheets.iter().find(is_motion).map(|sheet| sheet.name.clone());
    desired.motion = desired.motion.or_else(first);
    if let [robot] = &robots[..] {
        desired.robot_in_motion = desired.motion.as_ref().and_then(|motion| {
            let motion = sheets.iter().find(|sheet| sheet.name == *motion)?;
            named_otherwise(motion, Path::new(robot))
        });
        desired.robot = Some(robot.clone());
    }
    Ok((sheets, desired))
}

/// Reads a file that another file names; returns `None` if it is neither a document nor a plan.
fn mentioned(path: &Path, folders: &[PathBuf]) -> Option<Sheet> {
    // The engine finds shipped files by their names, and reports missing files with the file that mentions them.
    let read = files::read_by(path, PathSource::InFile { named: "" }, kind_by_beginning).ok()?;
    let text = files::text(read, path).ok()?;
    // The studio serves only documents and plans. Plans of libraries are no documents.
    let is_ours = Kind::expect_document(path, &text).is_ok() || Kind::of(&text) == Some(Kind::Plan);
    let folder = folder_of(path);
    let is_users =
        folder.is_some_and(|of_file| folders.iter().any(|folder| of_file.starts_with(folder)));
    is_ours.then(|| Sheet { name: name_of(path), path: path.to_owned(), text, is_users })
}

/// Path of a robot as a motion file would contain it; `None` if the motion file already names this robot.
fn named_otherwise(motion: &Sheet, robot: &Path) -> Option<String> {
    let whole = |path: &Path| fs::canonicalize(path).or_else(|_| std::path::absolute(path)).ok();
    let named = FileReferences::of(&motion.text).robot?;
    let (named, robot) = (whole(&resolve_relative(&motion.path, &named))?, whole(robot)?);
    let folder = whole(&motion.path)?.parent()?.to_owned();
    let shared = folder.components().zip(robot.components()).take_while(|(a, b)| a == b).count();
    let up = folder.components().skip(shared).map(|_| "..".to_owned());
    let down = robot.components().skip(shared);
    let down = down.map(|part| part.as_os_str().to_string_lossy().into_owned());
    (named != robot).then(|| up.chain(down).collect::<Vec<_>>().join("/"))
}

/// Text of a file that the user named.
fn text_of(path: &Path) -> miette::Result<String> {
    if path.is_dir() {
        return Err(is_folder(path));
    }
    let read = files::read_by(path, PathSource::ByUser, kind_by_beginning)?;
    if read.1 == Kind::Packed {
        return Err(miette!(
            help = "open the library file (TOML) from which it was built",
            "{} is a motion library for a controller, which the studio does not open",
            path.display()
        ));
    }
    Ok(files::text(read, path)?)
}

/// Kind of a file by its first bytes, for the size limit.
fn kind_by_beginning(start: &[u8]) -> Kind {
    match start.first() {
        Some(b'{') => Kind::Plan,
        Some(b'<') => Kind::Urdf,
        _ if start.starts_with(PACKED) => Kind::Packed,
        _ => Kind::Motion,
    }
}

fn is_folder(path: &Path) -> Report {
    let of = |folder: &Path| {
        let entries = fs::read_dir(folder).into_iter().flatten().flatten();
        let mut paths: Vec<_> = entries.map(|entry| entry.path()).collect();
        paths.sort();
        paths
    };
    let is_ours = |path: &PathBuf| {
        let endings = ["toml", "urdf", "json"];
        path.extension().is_some_and(|ending| endings.iter().any(|ours| ending == *ours))
    };
    let inner = of(path);
    let below = inner.iter().filter(|path| path.is_dir()).flat_map(|folder| of(folder));
    let files = inner.iter().cloned().chain(below).filter(is_ours);
    let names: Vec<_> = files.take(LISTED).map(|path| path.display().to_string()).collect();
    let help = if names.is_empty() {
        "give a motion, library, robot or design file (TOML), a URDF or a plan".to_owned()
    } else {
        format!("give a file, such as {}", names.join(", "))
    };
    miette!(help = help, "{} is a folder, but the studio opens files only", path.display())
}

/// Role of a file that the user named.
#[derive(Clone, Copy)]
enum Role {
    Robot,
    Motion,
    Library,
    Design,
    Plan,
    Urdf,
    Side,
    /// Document with mistakes.
    Other,
}

fn role(
    path: &Path,
    text: &str,
    mentions: &FileReferences,
    paths: &[PathBuf],
) -> miette::Result<Role> {
    let ends_in = |path: &Path, ending: &str| path.extension().is_some_and(|found| found == ending);
    let has_urdf =
        || paths.iter().any(|path| ["urdf", "xml"].iter().any(|ending| ends_in(path, ending)));
    let kind = Kind::of(text);
    match kind {
        Some(Kind::Plan) => return Ok(Role::Plan),
        Some(Kind::Urdf) => return Ok(Role::Urdf),
        None if ends_in(path, "toml") && !mentions.is_document && has_urdf() => {
            return Ok(Role::Side);
        }
        _ => Kind::expect_document(path, text)?,
    }
    Ok(match kind {
        Some(Kind::Robot) => Role::Robot,
        Some(Kind::Library) => Role::Library,
        Some(Kind::Design) => Role::Design,
        Some(Kind::Motion) => Role::Motion,
        _ if mentions.is_motion => Role::Motion,
        _ if mentions.is_library => Role::Library,
        _ => Role::Other,
    })
}

/// Name of the motion file of a plan, among the open files or else the shipped files.
///
/// # Errors
/// Returns an error if neither contains the motion of the plan.
fn motion_of(plan: &Sheet, sheets: &[Sheet]) -> miette::Result<String> {
    let value: Value = serde_json::from_str(&plan.text).unwrap_or_default();
    let [motion, robot] =
        ["motion", "robot"].map(|of| value[of]["name"].as_str().unwrap_or_default());
    if motion.is_empty() || robot.is_empty() {
        let help = "make the plan again: rollwalk plan MOTION.toml -o PLAN.json";
        return Err(miette!(
            help = help,
            "{} is damaged: the motion or the robot is missing",
            plan.name
        ));
    }
    let is_it = |text: &str| {
        let document = Document::parse(text).ok();
        let string = |key| document.as_ref()?.get(key)?.as_str();
        let names_robot = || Some(Path::new(string("robot")?).file_stem()? == robot);
        string("name") == Some(motion) && names_robot() == Some(true)
    };
    let open = sheets.iter().map(|sheet| (&*sheet.name, &*sheet.text));
    let shipped = rollwalk_shipped::FILES.iter().copied();
    let shipped = shipped.filter(|(path, _)| path.starts_with("motions/"));
    let found = open.chain(shipped).find(|(_, text)| is_it(text));
    found.map(|(path, _)| path.to_owned()).ok_or_else(|| {
        let path = &plan.name;
        miette!(
            help = format!("give the motion file, too: rollwalk studio MOTION.toml {path}"),
            "{path} is a plan of motion `{motion}` of robot `{robot}`, but does not contain the \
             motion file"
        )
    })
}

/// Folder of a file, with links followed; `None` if the file does not exist.
fn folder_of(path: &Path) -> Option<PathBuf> {
    Some(fs::canonicalize(path).ok()?.parent()?.to_owned())
}

/// Name of a path in pages, with `/` between folders.
fn name_of(path: &Path) -> String {
    path.to_string_lossy().replace('\\', "/")
}

/// Kind of a text according to its keys, and the files that it names.
#[derive(Default)]
struct FileReferences {
    is_document: bool,
    is_motion: bool,
    is_library: bool,
    robot: Option<String>,
    others: Vec<String>,
}

impl FileReferences {
    fn of(text: &str) -> Self {
        let Ok(document) = Document::parse(text) else { return Self::default() };
        let root = document.as_table();
        let robot = root.get("robot").and_then(Item::as_str).map(str::to_owned);
        let tables = root.get("motion").and_then(Item::as_array_of_tables).into_iter().flatten();
        let tables = tables.map(|table| table as &dyn TableLike);
        let inline = root.get("motions").and_then(Item::as_array).into_iter().flatten();
        let inline = inline.filter_map(|value| Some(value.as_inline_table()? as &dyn TableLike));
        let mut others = Vec::new();
        for table in tables.chain(inline) {
            let named = ["file", "plan"].into_iter().filter_map(|key| table.get(key)?.as_str());
            others.extend(named.map(str::to_owned));
        }
        Self {
            is_document: robot.is_some() || root.contains_key("link"),
            is_motion: root.contains_key("footfalls"),
            is_library: root.contains_key("safe"),
            robot,
            others,
        }
    }

    fn all(&self) -> impl Iterator<Item = &String> {
        self.robot.iter().chain(&self.others)
    }
}
