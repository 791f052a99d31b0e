//! The README's tutorial works as it is written: its files are taken from the text and its commands
//! run in order.

use crate::desk;
use rollwalk_tests::checkout;
use std::fs;

#[test]
fn the_tutorial_works_as_written() {
    let readme = fs::read_to_string(checkout().join("README.md")).unwrap();
    let (_, after) = readme.split_once("## Your own robot and motion").expect("the tutorial");
    let (tutorial, _) = after.split_once("\n## ").expect("a section after the tutorial");
    let desk = desk();
    let (mut files, mut commands) = (0, 0);
    let mut text = String::new();
    let mut parts = tutorial.split("```");
    while let (Some(prose), Some(block)) = (parts.next(), parts.next()) {
        text.push_str(prose);
        let (language, body) = block.split_once('\n').expect("a block has lines");
        match language {
            "toml" => {
                // The last file named before the block is the one it shows.
                let named = text.split('`').skip(1).step_by(2).filter(|s| s.ends_with(".toml"));
                desk.write(named.last().expect("a file name before its text"), body);
                files += 1;
            }
            "sh" => {
                for line in body.lines() {
                    let words: Vec<&str> = line.split_whitespace().collect();
                    assert_eq!(words[0], "rollwalk", "{line}");
                    desk.run(&words[1..]).succeeds();
                    commands += 1;
                }
            }
            other => panic!("a block of {other:?}"),
        }
    }
    // Robot, three motions and library; check, plan, report, plot, plan, build, inspect, demo.
    assert_eq!((files, commands), (5, 8));
}
