//! Names of the motions and channels of the controller's library.
//!
//! Names come from the user's cache, which every build and transfer of a library fills, or from the library file. Channel names
//! also come from the robot file.

use crate::inputs::Source;
use crate::kind::Kind;
use crate::validated_library::{self, ValidatedLibrary, actuators, channel_names};
use crate::{files, output};
use directories::ProjectDirs;
use miette::IntoDiagnostic;
use rollwalk_host::catalog::Catalog;
use rollwalk_protocol::wire::transport::Hello;
use rollwalk_robot::{Robot, Solid};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fs;
use std::path::{Path, PathBuf};

/// Sources of names.
#[derive(Clone, Default, clap::Args)]
pub struct NamesArgs {
    /// Motion library (.rwl) with the names of motions, if it was not built or flashed on this computer.
    #[arg(long, value_name = "LIB.rwl")]
    pub library: Option<PathBuf>,
    /// Robot file (TOML) with the names of joints, if the robot does not ship with rollwalk.
    #[arg(long, value_name = "ROBOT.toml")]
    pub robot: Option<PathBuf>,
}

impl NamesArgs {
    /// Returns the names of the library with the given identity; `None` if they are unknown.
    ///
    /// # Errors
    /// Returns an error if a file that the user named is missing or wrong.
    pub fn find(&self, library: u32) -> miette::Result<Option<Catalog>> {
        let Some(path) = &self.library else { return Ok(cached(library)) };
        let catalog = ValidatedLibrary::read(path, self.robot.as_deref())?.catalog();
        if catalog.library != library {
            output::print_line(format_args!(
                "{} is library {:08x}, but the controller has library {library:08x}: names may be \
                 wrong",
                path.display(),
                catalog.library
            ));
        }
        Ok(Some(catalog))
    }

    /// Returns the configuration hash of the robot that the user named, directly or by a library.
    ///
    /// # Errors
    /// Returns an error if a file that the user named is missing or wrong.
    pub fn config_hash(&self) -> miette::Result<Option<u32>> {
        let robot = match (&self.library, &self.robot) {
            (Some(library), robot) => ValidatedLibrary::read(library, robot.as_deref())?.robot,
            (None, Some(robot)) => Source::Disk.robot(robot)?,
            (None, None) => return Ok(None),
        };
        Ok(Some(robot.controller_config().into_diagnostic()?.hash()))
    }

    /// Returns the robot with the given configuration and the solids of its links, for pictures. The robot is the one that the
    /// user named, or else one that ships with rollwalk.
    ///
    /// # Errors
    /// Returns an error if the file that the user named is missing or wrong.
    pub fn robot(&self, config_hash: u32) -> miette::Result<Option<(Robot, Vec<Vec<Solid>>)>> {
        if let Some(path) = &self.robot {
            let (robot, parts) = Source::Disk.robot_and_parts(path)?;
            if robot.controller_config().into_diagnostic()?.hash() == config_hash {
                return Ok(Some((robot, parts)));
            }
        }
        let shipped = validated_library::file_of(config_hash);
        shipped.map(|file| Source::Shipped.robot_and_parts(file)).transpose()
    }

    /// Returns the names for a controller. If its library is known, they include motions and channels; if only its robot is
    /// known, only channels.
    ///
    /// # Errors
    /// Returns an error if a file that the user named is missing or wrong.
    pub fn look_up(&self, hello: Option<&Hello>) -> miette::Result<Option<Catalog>> {
        let named = self.robot.as_deref().map(|path| named_robot(path, hello)).transpose()?;
        let library = hello.and_then(|hello| hello.library);
        if let Some(catalog) = library.map(|library| self.find(library)).transpose()?.flatten() {
            return Ok(Some(catalog));
        }
        let (robot, config_hash) = match (named, hello) {
            (Some(named), _) => named,
            (None, Some(hello)) => match validated_library::robot_of(hello.config_hash) {
                Some(robot) => (robot, hello.config_hash),
                None => return Ok(None),
            },
            (None, None) => return Ok(None),
        };
        let catalog = Catalog::of_robot(&robot.name, config_hash, channel_names(&robot));
        Ok(Some(catalog.with_actuators(actuators(&robot))))
    }
}

/// Reads a robot file with its configuration hash, and warns if the controller has another configuration.
fn named_robot(path: &Path, hello: Option<&Hello>) -> miette::Result<(Robot, u32)> {
    let robot = Source::Disk.robot(path)?;
    let config_hash = robot.controller_config().into_diagnostic()?.hash();
    if let Some(hello) = hello.filter(|hello| hello.config_hash != config_hash) {
        let of = validated_library::robot_of(hello.config_hash);
        let of = of.map_or_else(|| "another robot".to_owned(), |robot| robot.name);
        output::print_line(format_args!(
            "{} does not describe the controller's robot ({of}): names may be wrong",
            path.display()
        ));
    }
    Ok((robot, config_hash))
}

/// Caches the names of a library. A failed write is reported, but is not an error.
pub fn cache(catalog: &Catalog) {
    cache_data(catalog.library, NAMES, catalog);
}

/// Cached names of the library with the given identity.
pub fn cached(library: u32) -> Option<Catalog> {
    cached_data(library, NAMES).filter(|catalog: &Catalog| catalog.library == library)
}

/// Extension of the cache file with the names of a library.
const NAMES: &str = "json";

/// Caches data of a library. `ending` is the extension of the cache file.
pub fn cache_data(library: u32, ending: &str, what: &impl Serialize) {
    let Some(path) = cache_path(library, ending) else { return };
    let text = serde_json::to_string_pretty(what).unwrap_or_default();
    // The writer reports a folder that cannot be created.
    let _ = fs::create_dir_all(files::folder(&path));
    if let Err(error) = files::write(&path, text.as_bytes()) {
        output::print_line(format_args!("cannot cache the names of the library: {error}"));
    }
}

/// Reads cached data of the library with the given identity. `ending` is the extension of the cache file.
pub fn cached_data<T: DeserializeOwned>(library: u32, ending: &str) -> Option<T> {
    let text = files::read_text(&cache_path(library, ending)?, Kind::Names).ok()?;
    serde_json::from_str(&text).ok()
}

fn cache_path(library: u32, ending: &str) -> Option<PathBuf> {
    let folders = ProjectDirs::from("", "", "rollwalk")?;
    Some(Path::new(folders.cache_dir()).join(format!("libraries/{library:08x}.{ending}")))
}
