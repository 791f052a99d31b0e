//! Input made to hurt: it is refused or read, in bounded time, never with a panic.

use super::{SIDE, URDF, imported};
use proptest::prelude::*;
use rollwalk_robot::urdf::{Text, survey};
use std::fmt::Write;

#[test]
fn entity_bombs_are_refused() {
    let mut bomb = "<!DOCTYPE robot [<!ENTITY a0 \"ha\">".to_owned();
    for level in 1..30 {
        let last = format!("&a{};", level - 1);
        let _ = write!(bomb, "<!ENTITY a{level} \"{}\">", last.repeat(10));
    }
    bomb += "]><robot name=\"&a29;\"/>";
    let error = imported(&bomb, SIDE).unwrap_err();
    assert!(error.to_string().contains("<!DOCTYPE"), "{error}");
    let file = "<!DOCTYPE robot [<!ENTITY f SYSTEM \"file:///etc/passwd\">]><robot name=\"&f;\"/>";
    assert!(imported(file, SIDE).unwrap_err().to_string().contains("<!DOCTYPE"));
}

#[test]
fn deep_and_long_files_end() {
    let deep =
        format!("<robot name=\"r\">{}{}</robot>", "<a>".repeat(100_000), "</a>".repeat(100_000));
    assert!(imported(&deep, SIDE).unwrap_err().to_string().contains("no <link>"));
    for (links, words) in [
        (2000, "no link of the robot has a mass"),
        (100_000, "the robot has 100000 <link> elements (and 1 more error)"),
    ] {
        let mut long = "<robot name=\"r\"><link name=\"l0\"/>".to_owned();
        for link in 1..links {
            let parent = link - 1;
            let _ = write!(
                long,
                "<link name=\"l{link}\"/><joint name=\"j{link}\" type=\"fixed\"><parent link=\"l{parent}\"/><child link=\"l{link}\"/></joint>"
            );
        }
        long += "</robot>";
        let error = imported(&long, "").unwrap_err().to_string();
        assert!(error.contains(words), "{error}");
    }
    let huge = format!("<robot name=\"r\"/>{}", " ".repeat(17 << 20));
    assert!(imported(&huge, SIDE).unwrap_err().to_string().contains("bytes"));
}

#[test]
fn every_beginning_of_a_file_is_refused_or_read() {
    for end in (0..URDF.len()).step_by(97).filter(|end| URDF.is_char_boundary(*end)) {
        assert!(imported(&URDF[..end], SIDE).is_err());
        assert!(survey(Text { name: "u", text: &URDF[..end] }).is_err());
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, failure_persistence: None, ..Default::default() })]

    /// Values, words and tags of the file exchanged at random.
    #[test]
    fn shuffled_files_never_panic(swaps in prop::collection::vec((0_usize..2000, 0_usize..2000), 1..6)) {
        let mut words: Vec<&str> = URDF.split('"').collect();
        for (a, b) in swaps {
            // Odd places are values of attributes: the file stays XML.
            let odd = |at: usize| at % (words.len() / 2) * 2 + 1;
            let (a, b) = (odd(a), odd(b));
            if a < words.len() && b < words.len() {
                words.swap(a, b);
            }
        }
        let urdf = words.join("\"");
        if let Ok(found) = survey(Text { name: "u", text: &urdf }) {
            let _ = imported(&urdf, &found.template);
        }
        let _ = imported(&urdf, SIDE);
    }
}
