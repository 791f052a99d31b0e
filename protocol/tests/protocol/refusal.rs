//! Refusals of libraries that were changed and then given valid checksums.

use crate::fixture::Fixture;
use crate::reseal::{find_section, reseal};
use rollwalk_protocol::library::{Reject, Section, validate};

/// Refusal of a fixture's library after `change`.
#[track_caller]
pub fn refusal(fixture: &Fixture, change: impl FnOnce(&mut Vec<u8>)) -> Reject {
    let mut bytes = fixture.encode();
    change(&mut bytes);
    reseal(&mut bytes);
    validate(&bytes, &fixture.config).expect_err("a change that must be refused")
}

/// Refusal after setting byte `at` of a section's payload to `value`.
#[track_caller]
pub fn patched(fixture: &Fixture, tag: usize, at: usize, value: u8) -> Reject {
    refusal(fixture, |bytes| {
        let start = find_section(bytes, tag).expect("the fixture has the section").start;
        assert_ne!(bytes[start + at], value, "no change");
        bytes[start + at] = value;
    })
}

/// Checks the section and the text of a refusal.
#[track_caller]
pub fn expect(reject: Reject, section: Section, sentence: &str) {
    assert_eq!(reject.section, section, "{reject}");
    let text = reject.to_string();
    assert!(text.contains(sentence), "{text:?} does not say {sentence:?}");
}
