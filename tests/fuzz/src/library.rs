//! Fuzz target for motion libraries: arbitrary bytes, forged libraries with valid checksums, and encoded ones. Every valid
//! library is played for ten seconds with commands in between. Playback must stay within the robot's limits.

mod play;
#[path = "../../../protocol/tests/protocol/reseal.rs"]
mod reseal;
mod spec;

use arbitrary::{Result, Unstructured};
use rollwalk_protocol::config::RobotConfig;
use rollwalk_protocol::library::{Library, validate};

use crate::robot;

/// First byte of an input with the bytes of a library.
const AS_IS: u8 = 0;
/// First byte of an input with the bytes of a library whose lengths and checksums are corrected, so that its content is
/// reached.
const RESEALED: u8 = 1;
/// First byte of an input with a description of a robot and of motions to encode.
const DESCRIBED: u8 = 2;

/// Number of bytes before the library: the first byte and the commands.
const HEAD: usize = 1 + play::COMMANDS;

fn play_if_valid(bytes: &[u8], config: &RobotConfig, commands: &[u8]) {
    if let Ok(index) = validate(bytes, config) {
        let library = Library::open(bytes, &index).expect("the bytes that were validated");
        play::ten_seconds(&library, config, commands);
    }
}

fn described(commands: &[u8], description: &[u8]) -> Result<()> {
    let mut u = Unstructured::new(description);
    let (config, library) = spec::encoded(&mut u)?;
    if let Some(bytes) = library {
        let index = validate(&bytes, &config).expect("what the encoder lets pass is valid");
        let library = Library::open(&bytes, &index).expect("the bytes that were validated");
        play::ten_seconds(&library, &config, commands);
    }
    Ok(())
}

/// Runs a library, or a description of one, with the commands before it.
pub fn run(data: &[u8]) {
    let Some((head, body)) = data.split_first_chunk::<HEAD>() else { return };
    let (how, commands) = (head[0] % 3, &head[1..]);
    match how {
        AS_IS => play_if_valid(body, &robot::config(), commands),
        RESEALED => {
            let mut forged = body.to_vec();
            reseal::reseal(&mut forged);
            play_if_valid(&forged, &robot::config(), commands);
        }
        // An error means that the description was too short.
        _ => drop(described(commands, body)),
    }
}

/// Seeds with the libraries of the firmware's tests, and with descriptions.
pub fn seeds() -> Vec<Vec<u8>> {
    let commands: Vec<u8> = [[20, 1], [90, 2], [200, 0], [30, 2]].concat().repeat(2);
    let seed = |how: u8, body: &[u8]| [&[how], &commands[..play::COMMANDS], body].concat();
    let mut seeds = Vec::new();
    for library in [robot::library(), robot::library_that_settles(), spec::smallest()] {
        seeds.push(seed(AS_IS, &library));
        seeds.push(seed(RESEALED, &library));
    }
    // Of many descriptions, those that the encoder accepts, so that the fuzzer has examples that play.
    let descriptions = (1..=255u8).map(|n| -> Vec<u8> {
        (0..160u8).map(|i| i.wrapping_mul(n).wrapping_add(n) >> (n % 4)).collect()
    });
    let encodes =
        |text: &Vec<u8>| matches!(spec::encoded(&mut Unstructured::new(text)), Ok((_, Some(_))));
    let sound: Vec<_> = descriptions.filter(encodes).take(8).collect();
    assert_eq!(sound.len(), 8, "hardly a description is one");
    seeds.extend(sound.iter().map(|text| seed(DESCRIBED, text)));
    seeds
}
