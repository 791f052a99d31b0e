//! Tests of malicious input, which must be refused or read in bounded time, without a panic.

use super::{SIDE, URDF, imported};
use cpu_time::ThreadTime;
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
    let deep = |depth| {
        format!("<robot name=\"r\">{}{}</robot>", "<a>".repeat(depth), "</a>".repeat(depth))
    };
    assert!(imported(&deep(999), SIDE).unwrap_err().to_string().contains("no <link>"));
    let error = imported(&deep(100_000), SIDE).unwrap_err().to_string();
    assert!(error.contains(":1: more than 1000 elements are inside each other"), "{error}");
    for (links, words) in [
        (2000, "no link of the robot has a mass"),
        (50_000, "the robot has 50000 <link> elements (and 1 more error)"),
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

/// Tests inputs that make quadratic-time algorithms slow, each in a file of a few megabytes.
#[test]
fn many_of_anything_end_soon() {
    let list =
        |count: usize, item: &dyn Fn(usize) -> String| -> String { (0..count).map(item).collect() };
    let model = |before: &str, inside: &str| {
        format!("<mujoco>{before}<worldbody><body name=\"b\">{inside}</body></worldbody></mujoco>")
    };
    let geoms = "<geom size=\"0.1\"/>".repeat(19_000);
    let solid = "<inertial><mass value=\"1\"/><inertia ixx=\"1\" iyy=\"1\" izz=\"1\"/></inertial>";
    let branch = |k: usize, parent: usize| {
        format!(
            "<link name=\"l{k}\">{solid}</link><joint name=\"j{k}\" type=\"revolute\"><axis xyz=\"0 1 0\"/>\
             <limit lower=\"-1\" upper=\"1\"/><parent link=\"l{parent}\"/><child link=\"l{k}\"/></joint>"
        )
    };
    let robot = |inside: String| {
        format!("<robot name=\"r\"><link name=\"l0\">{solid}</link>{inside}</robot>")
    };
    let files = [
        (
            format!(
                "<robot name=\"r\"><link {}/></robot>",
                list(100_000, &|k| format!("a{k}=\"\" "))
            ),
            "<link> has more than 200 attributes",
        ),
        (
            format!("<robot {}/>", list(50_000, &|k| format!("xmlns:a{k}=\"u{k}\" "))),
            "declares more than 64 namespaces",
        ),
        (list(50_000, &|k| format!("<a xmlns:a{k}=\"u\">")), "declares more than 64 namespaces"),
        (robot(format!("<link name=\"{}\"/>", "n".repeat(1 << 20))), "`name` has 1048576 bytes"),
        (format!("<robot><{}/></robot>", "n".repeat(1 << 20)), "a name has 1048576 bytes"),
        (robot("<a/>".repeat(300_000)), "more than 262144 XML nodes"),
        (robot("<a b='' c=''/>".repeat(260_000)), "more than 500000 attributes"),
        (robot(list(1990, &|k| branch(k + 1, 0))), ""),
        (robot(list(1990, &|k| branch(k + 1, k))), "1990 joints of the robot move"),
        (model("", &"<geom/>".repeat(100_000)), "<worldbody> has 100002 elements"),
        (model("", &"<joint/>".repeat(19_000)), "the model has too many joints"),
        (model("", &("<frame pos=\"x\">".repeat(900) + &"</frame>".repeat(900))), "`pos` is \"x\""),
        (
            model(&list(30_000, &|k| format!("<default class=\"c{k}\"/>")), &geoms),
            "30000 classes of defaults",
        ),
        (
            model(
                &format!("<default><geom pos=\"{}\"/></default>", "0.0 ".repeat(100_000)),
                &geoms,
            ),
            "`pos` is \"0.0 0.0",
        ),
        (
            model(&format!("<compiler eulerseq=\"{}\"/>", "x".repeat(1 << 20)), &geoms),
            "`eulerseq` has 1048576 bytes",
        ),
    ];
    for (text, words) in files {
        let start = ThreadTime::now();
        let found = survey(Text { name: "u", text: &text });
        let error = found.map_or_else(|error| error.to_string(), |_| String::new());
        assert!(error.contains(words), "{words}: {error}");
        assert!(error.len() < 1200, "{words}: {} bytes", error.len());
        let _ = imported(&text, SIDE);
        assert!(start.elapsed().as_secs_f64() < 10.0, "{words}: {:?}", start.elapsed());
    }
    // Many defaults are looked up fast.
    let defaults = list(20_000, &|k| format!("<geom a{k}=\"1\"/>"));
    let start = ThreadTime::now();
    survey(Text { name: "u", text: &model(&format!("<default>{defaults}</default>"), &geoms) })
        .unwrap();
    assert!(start.elapsed().as_secs_f64() < 10.0, "{:?}", start.elapsed());
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

    /// Tests files with values, words and tags exchanged at random.
    #[test]
    fn shuffled_files_never_panic(swaps in prop::collection::vec((0_usize..2000, 0_usize..2000), 1..6)) {
        let mut words: Vec<&str> = URDF.split('"').collect();
        for (a, b) in swaps {
            // Odd positions are values of attributes, so the file stays XML.
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
