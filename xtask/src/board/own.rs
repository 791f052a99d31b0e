//! `cargo xtask image`: the image of a board for a robot of one's own. The bench makes the robot's module and says how it is
//! connected; the board's program is built with it, and written as the board's boot loader takes it.

use super::bench::{Bench, Module};
use super::contents::{self, Sections};
use super::formats::Format;
use super::image::{self, Image};
use super::{Board, real, shown, sizes};
use crate::shell;
use clap::ValueEnum;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::{fs, io};

/// Command line.
#[derive(clap::Args)]
pub struct Options {
    /// Robot file (TOML).
    #[arg(long, value_name = "ROBOT.toml")]
    robot: PathBuf,
    /// The board.
    #[arg(long)]
    board: Board,
    /// File for the image: its ending chooses the format. Without it, one file of each format of the board in the target
    /// folder.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

/// What an image of a board becomes.
struct Product {
    image: Image,
    /// Where its own variables are.
    ram: Range<u64>,
    /// Bytes of flash for the program.
    flash: u64,
    formats: &'static [Format],
    /// How each of these files gets onto the board; `FILE` stands for its name.
    flashing: &'static [(Format, &'static str)],
}

const NUCLEO_FLASHING: [(Format, &str); 3] = [
    (Format::Elf, "probe-rs run --chip STM32G474RETx FILE"),
    (Format::Bin, "copy FILE onto the drive NOD_G474RE, which the board's debugger is"),
    (Format::Bin, "STM32_Programmer_CLI -c port=SWD -w FILE 0x08000000 -rst"),
];
/// Family of RP2350 programs for the Arm cores in secure mode (RP2350 datasheet, 5.5.3).
const RP2350_ARM: u32 = 0xE48B_FF59;
const PICO_FLASHING: [(Format, &str); 3] = [
    (Format::Elf, "probe-rs run --chip RP235x FILE"),
    (
        Format::Uf2(RP2350_ARM),
        "hold BOOTSEL, plug the USB cable in, copy FILE onto the drive RP2350",
    ),
    (Format::Uf2(RP2350_ARM), "picotool load -x FILE"),
];
const EMULATOR: (Format, &str) = (
    Format::Elf,
    "qemu-system-arm -M mps2-an386 -cpu cortex-m4 -display none -serial pty -kernel FILE",
);

fn product(board: Board) -> Product {
    let emulated = |image| Product {
        image,
        ram: sizes::RAM,
        flash: 128 << 10,
        formats: &[Format::Elf],
        flashing: &[EMULATOR],
    };
    match board {
        Board::Mps2An386 => emulated(image::MPS2_AN386),
        Board::Mps2An386Slcan => emulated(image::MPS2_AN386_SLCAN),
        Board::NucleoG474re => Product {
            image: image::NUCLEO_G474RE,
            ram: real::NUCLEO.ram,
            flash: real::NUCLEO.flash_bytes,
            formats: &[Format::Elf, Format::Bin],
            flashing: &NUCLEO_FLASHING,
        },
        Board::Pico2 => Product {
            image: image::PICO2,
            ram: real::PICO.ram,
            flash: real::PICO.flash_bytes,
            formats: &[Format::Elf, Format::Uf2(RP2350_ARM)],
            flashing: &PICO_FLASHING,
        },
    }
}

/// Builds the image and prints how the robot is connected, sizes, and how the board gets the image.
///
/// # Errors
/// What the board has not got for the robot, before anything is built; the compiler's verdict; a file that cannot be
/// written.
pub fn run(options: &Options) -> Result<(), String> {
    let Product { image, ram, flash, formats, flashing } = product(options.board);
    let name = options.board.to_possible_value().map_or_else(String::new, |v| v.get_name().into());
    let outputs = outputs(options, formats, &name)?;

    let Module { path: module, wiring } = Bench::program()?.module(&options.robot, &name)?;
    let built = contents::read(&image.build_for(&module)?)?;
    let panics = contents::panic_paths(&built)?;
    if !panics.is_empty() {
        return Err(format!("the image can panic: {}", panics.join(", ")));
    }
    for (format, path) in &outputs {
        save(path, &format.of(&built)?).map_err(|error| format!("{}: {error}", shown(path)))?;
    }

    let Sections { text, data, bss } = contents::sections(&built, ram.clone())?;
    println!("{} on {name}\n\n{wiring}", options.robot.display());
    println!("flash {text} B of {flash}, RAM {} B of {}", data + bss, ram.end - ram.start);
    for (format, path) in outputs {
        println!("\n{}", shown(&path));
        for (_, how) in flashing.iter().filter(|(flashed, _)| *flashed == format) {
            println!("  {}", how.replace("FILE", &shown(&path)));
        }
    }
    Ok(())
}

/// The files to write: the one that the user names, or one of each format.
fn outputs(
    options: &Options,
    formats: &[Format],
    board: &str,
) -> Result<Vec<(Format, PathBuf)>, String> {
    let Some(path) = &options.output else {
        let robot = options.robot.file_stem().unwrap_or_default().to_string_lossy();
        let stem = shell::target_folder().join("board").join(format!("{robot}-{board}"));
        return Ok(formats
            .iter()
            .map(|format| {
                (*format, PathBuf::from(format!("{}.{}", stem.display(), format.extension())))
            })
            .collect());
    };
    let format = formats.iter().find(|format| format.is_of(path)).ok_or_else(|| {
        let endings: Vec<_> =
            formats.iter().map(|format| format!(".{}", format.extension())).collect();
        format!("{}: images of {board} end with {}", path.display(), endings.join(" or "))
    })?;
    Ok(vec![(*format, path.clone())])
}

/// Writes a file in place, so that links and devices stay what they are.
fn save(path: &Path, bytes: &[u8]) -> io::Result<()> {
    if let Some(folder) = path.parent().filter(|folder| folder.starts_with(shell::target_folder()))
    {
        fs::create_dir_all(folder)?;
    }
    fs::write(path, bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ending_of_the_file_chooses_the_format() {
        let options = |board, output: Option<&str>| Options {
            robot: "robots/pup.toml".into(),
            board,
            output: output.map(PathBuf::from),
        };
        let outputs_of = |board, output| {
            let options = options(board, output);
            outputs(&options, product(board).formats, "this board")
        };
        let of_file = outputs_of(Board::Pico2, Some("a/b.uf2"));
        assert_eq!(of_file, Ok(vec![(Format::Uf2(RP2350_ARM), "a/b.uf2".into())]));
        let why = outputs_of(Board::NucleoG474re, Some("b.uf2")).unwrap_err();
        assert_eq!(why, "b.uf2: images of this board end with .elf or .bin");
        assert!(outputs_of(Board::Mps2An386, Some("image")).is_err());

        let both = outputs_of(Board::NucleoG474re, None).unwrap();
        let names: Vec<_> = both.iter().map(|(_, path)| path.file_name().unwrap()).collect();
        assert_eq!(names, ["pup-this board.elf", "pup-this board.bin"]);
    }
}
