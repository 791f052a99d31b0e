//! Golden bytes of libraries of formats 1.0 to 1.2. Do not change them: such libraries are stored in robots. If a test here
//! fails, the code is wrong, or the format needs a new version. One attitude was changed when a tilt beyond 60° became invalid
//! for every robot.

use crate::fixture::robot;
use rollwalk_protocol::library::{
    Attitude, ClipCursor, ClipId, Library, LibrarySpec, MotionSpec, NodeId, TransitionSpec,
    encode_with_attitudes, validate,
};

/// Library with attitudes and torques. Do not change it.
const GOLDEN_1_2: &str = "\
524f4c4c57414c4b010002003402000000000000e48dce0101000a000a000000
7eded3f13c0002020200020008001000000000f600fa0006670001f600e00020
0104030013004c00000001010000000000120000000000000000400000004000
12000000450000009ad900003333fa0000020057000000130000000000000000
4000000002006a0000001300000000009ad933336400040001007d0000000001
000008005cc87e366400000000000000013c000023005f3a9225640000020300
0000034892c44e92c4034e92c44e92c4034e92c44e92c4034e92c44e0001043c
000e000b778fb06a000002ffff0000a10008c0ff010202000009007dfa0dcd64
00000000000002000302000009009237c68d640000000000000000050006000c
00000000010000000001003f0000000600010004000000000001010700020004
00000003010700080002000400000064000000090001000a000000057374616e
64036e6f640a00010002000000f7f60b00080020000000000000001200000012
0000004500000057000000130000006a000000130000000c0001007d00000000
0100000800b2c023ae9cff000000000000013c00002300794eb47a9cff0001fd
ff0000039024a99524a9039524a99524a9039524a99524a9039524a995000104
3c000e0011a0a4cf96ff00010100000092001080ff01020200000900d1183ab6
9cff00000000000100030200000900a77d16c29cff0000000000000052574c2d
454e442e34020000af5d8d3e00000000e591c6eb
";

/// Library with attitudes. Do not change it.
const GOLDEN_1_1: &str = "\
524f4c4c57414c4b010001007d010000000000006db0daf001000a000a000000
7eded3f13c0002020200020008001000000000f600fa0006670001f600e00020
0104030013004c00000001010000000000120000000000000000400000004000
12000000450000009ad900003333fa0000020057000000130000000000000000
4000000002006a0000001300000000009ad933336400040001007d0000000001
000008005cc87e366400000000000000013c000023005f3a9225640000020300
0000034892c44e92c4034e92c44e92c4034e92c44e92c4034e92c44e0001043c
000e000b778fb06a000002ffff0000a10008c0ff010202000009007dfa0dcd64
00000000000002000302000009009237c68d640000000000000000050006000c
00000000010000000001003f0000000600010004000000000001010700020004
00000003010700080002000400000064000000090001000a000000057374616e
64036e6f6452574c2d454e442e7d010000fe0f100b00000000b641b5c0
";

/// Library without attitudes and torques. Do not change it.
const GOLDEN_1_0: &str = "\
524f4c4c57414c4b010000005d0100000000000051ae8c3601000a000a000000
7eded3f13c0002020200020008001000000000f600fa0006670001f600e00020
010403000b002c00000001010000000000120000000040001200000045000000
00020057000000130000000002006a00000013000000040001007d0000000001
000008005cc87e366400000000000000013c000023005f3a9225640000020300
0000034892c44e92c4034e92c44e92c4034e92c44e92c4034e92c44e0001043c
000e000b778fb06a000002ffff0000a10008c0ff010202000009007dfa0dcd64
00000000000002000302000009009237c68d640000000000000000050006000c
00000000010000000001003f0000000600010004000000000001010700020004
00000003010700080002000400000064000000090001000a000000057374616e
64036e6f6452574c2d454e442e5d0100001f4283ed000000003780265b
";

fn golden(hex: &str) -> Vec<u8> {
    let digits: Vec<u8> = hex.bytes().filter(u8::is_ascii_hexdigit).collect();
    let byte = |pair: &[u8]| u8::from_str_radix(std::str::from_utf8(pair).unwrap(), 16).unwrap();
    digits.chunks(2).map(byte).collect()
}

/// Joint that nods in steps of a few quanta while a wheel turns, and then stops: 64 frames, two blocks.
fn nod() -> Vec<f32> {
    let mut quanta = 100;
    let frame = |k: usize| {
        let frame = [quanta as f32 / 1024.0, if k == 63 { 0.0 } else { 0.5 }];
        quanta += [3, 2, 1, 0, -1, -2, -3, 0][k % 8];
        frame
    };
    (0..64).flat_map(frame).collect()
}

/// Torques for frames, in multiples of their quanta. They are opposite to the joint's angle, and in the direction of the
/// wheel's speed.
fn torques(frames: &[f32]) -> Vec<f32> {
    frames.chunks(2).flat_map(|frame| [-2.0 * frame[0], 0.5 * frame[1]]).collect()
}

fn spec_bytes(with_torques: bool) -> Vec<u8> {
    let config = robot(1, 1);
    let stand = [100.0 / 1024.0, 0.0];
    let to = [stand, [100.0 / 1024.0, 0.5]].concat();
    let clips = [stand.to_vec(), nod(), to, [stand, stand].concat()];
    let of = clips.each_ref().map(|c| if with_torques { torques(c) } else { vec![] });
    let motions = [
        MotionSpec { name: "stand", code: 7, looping: true, frames: &clips[0], torques: &of[0] },
        MotionSpec { name: "nod", code: 3, looping: false, frames: &clips[1], torques: &of[1] },
    ];
    let transitions = [
        TransitionSpec { torques: &of[2], ..TransitionSpec::new(0, 0, 1, 0, &clips[2]) },
        TransitionSpec { torques: &of[3], ..TransitionSpec::new(1, 63, 0, 0, &clips[3]) },
    ];
    let spec =
        LibrarySpec { config: &config, motions: &motions, transitions: &transitions, safe: 0 };
    let mut bytes = vec![0; 1000];
    let len = encode_with_attitudes(&spec, &ATTITUDES, &mut bytes).unwrap();
    bytes.truncate(len);
    bytes
}

/// Attitudes of the clips, in which the body tilts, too.
const ATTITUDES: [Attitude; 4] = [
    Attitude::LEVEL,
    Attitude { up_body: [-0.6, 0.0, 0.8], spread_rad: 0.25 },
    Attitude::LEVEL,
    Attitude { up_body: [0.0, -0.6, 0.8], spread_rad: 0.1 },
];

#[test]
fn encodes_to_the_golden_bytes() {
    let hex = |bytes: &[u8]| -> String {
        let line = |line: &[u8]| line.iter().map(|b| format!("{b:02x}")).collect::<String>();
        bytes.chunks(32).map(|l| line(l) + "\n").collect()
    };
    assert_eq!(hex(&spec_bytes(false)), hex(&golden(GOLDEN_1_1)));
    assert_eq!(hex(&spec_bytes(true)), hex(&golden(GOLDEN_1_2)));
}

#[test]
fn the_golden_bytes_still_play() {
    for (bytes, attitude, with_torques) in [
        (golden(GOLDEN_1_0), false, false),
        (golden(GOLDEN_1_1), true, false),
        (golden(GOLDEN_1_2), true, true),
    ] {
        let config = robot(1, 1);
        let index = validate(&bytes, &config).unwrap();
        let library = Library::open(&bytes, &index).unwrap();
        assert_eq!(library.name(NodeId(1)), Some("nod"));
        assert_eq!(library.node_for_code(3), Some(NodeId(1)));
        assert_eq!(library.attitude(ClipId(0)), attitude.then_some(Attitude::LEVEL));
        assert_eq!(library.attitude(ClipId(1)).map(|a| a.spread_rad), attitude.then_some(0.25));
        let mut cursor = ClipCursor::new(&library, ClipId(1), 0).unwrap();
        for expected in nod().chunks(2) {
            let mut frame = [0.0; 2];
            cursor.frame_into(&library, &mut frame).unwrap();
            assert_eq!(frame, expected, "multiples of a quantum return exactly");
            cursor.torques_into(&library, &mut frame).unwrap();
            let expected = if with_torques { torques(expected) } else { vec![0.0; 2] };
            assert_eq!(frame, *expected, "so do those of a torque");
            cursor.advance(&library).unwrap();
        }
    }
}
