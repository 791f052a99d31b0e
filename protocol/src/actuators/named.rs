//! Serialization of actuator models by name, for fields with `#[serde(with = "named")]`.

use core::fmt;
use core::marker::PhantomData;

use serde::de::{Error, Unexpected, Visitor};
use serde::{Deserializer, Serializer};

/// Model that files refer to by name.
pub trait Named: Copy + 'static {
    const ALL: &'static [Self];

    /// Name of the model.
    fn name(&self) -> &'static str;
}

/// Serializes the name of the model.
pub fn serialize<M: Named, S: Serializer>(model: &M, serializer: S) -> Result<S::Ok, S::Error> {
    serializer.serialize_str(model.name())
}

/// Deserializes the model with a given name.
pub fn deserialize<'de, M: Named, D: Deserializer<'de>>(deserializer: D) -> Result<M, D::Error> {
    deserializer.deserialize_str(NameVisitor(PhantomData))
}

struct NameVisitor<M>(PhantomData<M>);

impl<M: Named> Visitor<'_> for NameVisitor<M> {
    type Value = M;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("one of")?;
        M::ALL.iter().try_for_each(|model| write!(f, " {}", model.name()))
    }

    fn visit_str<E: Error>(self, given: &str) -> Result<M, E> {
        let found = M::ALL.iter().find(|model| model.name() == given);
        found.copied().ok_or_else(|| E::invalid_value(Unexpected::Str(given), &self))
    }
}
