//! Models of actuators in files: by their names.

use core::fmt;

use serde::Deserializer;
use serde::de::{Error, Unexpected, Visitor};

/// The one of `models` that a file names.
pub fn deserialize<'de, M: Copy, D: Deserializer<'de>>(
    deserializer: D,
    models: &'static [M],
    name: fn(&M) -> &'static str,
) -> Result<M, D::Error> {
    deserializer.deserialize_str(Named { models, name })
}

struct Named<M: 'static> {
    models: &'static [M],
    name: fn(&M) -> &'static str,
}

impl<M: Copy> Visitor<'_> for Named<M> {
    type Value = M;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("one of")?;
        self.models.iter().try_for_each(|model| write!(f, " {}", (self.name)(model)))
    }

    fn visit_str<E: Error>(self, given: &str) -> Result<M, E> {
        let found = self.models.iter().find(|model| (self.name)(model) == given);
        found.copied().ok_or_else(|| E::invalid_value(Unexpected::Str(given), &self))
    }
}
