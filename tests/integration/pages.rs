//! Tests of the commands in the documents. All shell commands must match the command line of their program. They are run in
//! order, in a folder for each document, with the files that they create.
//!
//! The info string of a code block selects the treatment; the rendered page does not show it. Blocks of ```` ```sh ```` run.
//! Blocks of ```` ```sh not-run: REASON ```` contain commands that need hardware, hours or another program. The test only
//! checks them against the command line. A block of ```` ```toml NAME.toml ```` is a file that later commands of the document
//! use. A command with the comment `# refused: WORDS` must fail with these words in its message. Each section has its own
//! terminals.

mod command;
mod document;
mod reader;

use command::{invalid_commands, unknown};
use document::{Document, documents};
use reader::Reader;
use std::panic::resume_unwind;
use std::sync::Mutex;
use std::thread;

/// Number of simultaneous readers, each with its own robot; they mostly wait for robots.
const READERS: usize = 2;

/// Runs the documents for which `is_chosen` returns true; returns the numbers of files written and of commands run.
fn follow(is_chosen: impl Fn(&Document) -> bool) -> (usize, usize) {
    let chosen: Vec<_> = documents().into_iter().filter(is_chosen).collect();
    let left = Mutex::new(chosen.iter());
    let read = || {
        let (mut files, mut commands) = (0, 0);
        while let Some(document) = next(&left) {
            let mut reader = Reader::new();
            reader.follow(document);
            if reader.commands > 0 {
                println!("{}: {} files, {} commands", document.path, reader.files, reader.commands);
            }
            files += reader.files;
            commands += reader.commands;
        }
        (files, commands)
    };
    thread::scope(|scope| {
        let readers = [(); READERS].map(|()| scope.spawn(read));
        let read = readers.map(|reader| reader.join().unwrap_or_else(|why| resume_unwind(why)));
        read.into_iter().fold((0, 0), |(files, commands), (f, c)| (files + f, commands + c))
    })
}

/// Returns the document for the next reader. The lock is released before the document is read.
fn next<'d>(left: &Mutex<impl Iterator<Item = &'d Document>>) -> Option<&'d Document> {
    left.lock().ok()?.next()
}

#[test]
fn every_command_of_the_documents_is_understood() {
    let (faults, checked) = invalid_commands(&documents());
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    println!("{checked} commands");
    assert!(checked > 80, "{checked} commands");
}

#[test]
fn every_command_that_the_documents_name_in_passing_exists() {
    let (mut faults, mut checked) = (Vec::new(), 0);
    // The changelog may name past commands.
    for document in documents().iter().filter(|one| one.path != "CHANGELOG.md") {
        for (line, span) in &document.spans {
            checked +=
                usize::from(span.starts_with("rollwalk ") || span.starts_with("rollwalk-sim "));
            faults.extend(
                unknown(span).map(|why| format!("{}:{line}: `{span}`: {why}", document.path)),
            );
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    println!("{checked} code spans");
    assert!(checked > 150, "{checked} code spans");
}

#[test]
fn the_commands_of_documents_without_a_robot_run() {
    let (files, commands) = follow(|document| !document.has_robot());
    // The README's tutorial has five files: robot, three motions and library.
    assert!(files >= 5 && commands > 10, "{files} files, {commands} commands");
}

/// Runs the commands of documents with a robot on the ground, with deadlines as for a user.
#[test]
fn in_real_time_the_commands_of_documents_with_a_robot_run() {
    let (_, commands) = follow(Document::has_robot);
    assert!(commands > 20, "{commands} commands");
}

#[test]
fn wrong_commands_of_a_document_are_named() {
    let text = "```sh\nrollwalk plan a.toml -o a.json   # fine\nrollwalk plan a.toml --ouptut a.json\n```\n\
                ```sh not-run: hours\nrollwalk-sim a.toml --bsu sim\ncargo run --release -- demo --otu x\npython3 any --thing\n```\n\
                ```sh later\nexport ROLLWALK_BUS=sim\nrollwalk discover\n```\n";
    let (faults, checked) = invalid_commands(&[Document::parse("docs/a.md", text)]);
    assert_eq!(checked, 2, "{faults:#?}");
    assert_eq!(faults.len(), 4, "{faults:#?}");
    for (fault, says) in faults.iter().zip([
        "docs/a.md:3: `rollwalk plan a.toml --ouptut a.json`: error: unexpected argument '--ouptut'",
        "docs/a.md:6: `rollwalk-sim a.toml --bsu sim`: error",
        "docs/a.md:7: `cargo run --release -- demo --otu x`: error",
        "docs/a.md:10: `later` is no mark",
    ]) {
        assert!(fault.starts_with(says), "{fault}");
    }
    assert_eq!(unknown("rollwalk plan M.toml --samples-fixed"), None);
    assert_eq!(unknown("rollwalk gains feed-forward 0"), None);
    assert_eq!(unknown("rollwalk plan --fro x"), Some("`plan` has no option `--fro`".into()));
    assert_eq!(unknown("rollwalk gains sett"), Some("`gains` has no command `sett`".into()));
    assert_eq!(unknown("planner/src"), None);
}

#[test]
#[should_panic(expected = "docs/a.md:2: `rollwalk robot check gone.toml`")]
fn a_command_that_fails_is_named() {
    let text = "```sh\nrollwalk robot check gone.toml\n```\n";
    Reader::new().follow(&Document::parse("docs/a.md", text));
}

#[test]
#[should_panic(expected = "mark the block `not-run: needs rm`")]
fn programs_of_others_are_not_run() {
    Reader::new().follow(&Document::parse("docs/a.md", "```sh\nrm -r robots\n```\n"));
}
