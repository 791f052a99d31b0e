//! Keys that a simulated controller requires of its hosts and of its libraries.

use super::{Cli, Part, boots};
use crate::signing;
use miette::miette;
use rollwalk_protocol::wire::authentication::LinkKey;
use rollwalk_sim_host::store::VerifyingKey;
use rollwalk_terminal::{keys, output};

/// Keys that the controller requires.
pub struct Keys {
    /// Link key, and the number of earlier boots of all controllers that use the key.
    pub link: Option<(LinkKey, u32)>,
    pub library: Option<VerifyingKey>,
}

impl Keys {
    /// Reads the keys, and counts a boot of a controller with the link key.
    ///
    /// # Errors
    /// Returns an error if a file cannot be read or contains no key, or if the boot cannot be counted.
    pub fn read(cli: &Cli) -> miette::Result<Self> {
        let link = cli.link_key.as_deref().map(keys::link_key).transpose()?;
        let library = cli.library_key.as_deref().map(signing::public_key).transpose()?;
        let Some(key) = link else { return Ok(Self { link: None, library }) };
        let before = match boots::count(&key)? {
            // Boots of this process begin with 1.
            Some(boot) => boot - 1,
            None if cli.only == Some(Part::Controller) => {
                return Err(miette!(
                    help = "set HOME or XDG_STATE_HOME to a persistent folder",
                    "there is no folder for the boot count, and without this count the controller \
                     would accept a recorded session after a restart"
                ));
            }
            None => {
                output::print_line(
                    "warning: there is no folder for the boot count, so the simulated robot \
                     accepts a recorded session after a restart",
                );
                0
            }
        };
        Ok(Self { link: Some((key, before)), library })
    }
}
