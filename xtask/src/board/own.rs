//! `cargo xtask image`: builds the image of a board for the user's own robot. The test bench ([`Bench`]) generates the robot's
//! module and describes the wiring. The board's program is built with this module, and written in the formats of the board's boot
//! loader.

use super::bench::{Bench, KeyFiles, Module};
use super::contents::{self, Sections};
use super::formats::Format;
use super::image::{self, Image};
use super::{Board, key_block, real, shown};
use crate::shell;
use clap::ValueEnum;
use std::fs::{self, OpenOptions};
use std::io::{self, Write};
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Options of the command.
#[derive(clap::Args)]
pub struct Options {
    /// Robot file (TOML).
    #[arg(long, value_name = "ROBOT.toml")]
    robot: PathBuf,
    /// Board to build the image for.
    #[arg(long)]
    board: Board,
    /// Image file; the extension selects the format. By default, one file of each format of the board in the target folder.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    #[command(flatten)]
    keys: KeyFiles,
}

/// Files of a board's image.
struct Product {
    image: Image,
    /// Address range of the program's variables.
    ram: Range<u64>,
    /// Size of the flash for the program, bytes.
    flash: u64,
    formats: &'static [Format],
    /// Flashing instructions for each format; `FILE` stands for the path.
    flashing: &'static [(Format, &'static str)],
}

const NUCLEO_FLASHING: [(Format, &str); 3] = [
    (Format::Elf, "probe-rs run --chip STM32G474RETx FILE"),
    (Format::Bin, "copy FILE onto the drive NOD_G474RE of the board's debugger"),
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
        ram: image::RAM,
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

/// Builds the image, and prints the wiring of the robot, the sizes, and the flashing instructions.
///
/// # Errors
/// Returns an error before the build if the board lacks a port for the robot, or if a key file contains no key. Returns an
/// error if the build fails, if the image exceeds the flash or RAM of the board, or if a file cannot be written.
pub fn run(options: &Options) -> Result<(), String> {
    let Product { image, ram, flash, formats, flashing } = product(options.board);
    let name = options.board.to_possible_value().map_or_else(String::new, |v| v.get_name().into());
    let outputs = outputs(options, formats, &name)?;

    let bench = Bench::program()?;
    let Module { path: module, wiring } = bench.module(&options.robot, &name)?;
    let Options { keys, .. } = options;
    let has_keys = !features(keys).is_empty();
    let block = has_keys.then(|| bench.key_block(&options.robot, keys)).transpose()?;
    let mut built = build(&image, &module, keys).map_err(|why| {
        if has_keys { format!("the image with keys cannot be built: {why}") } else { why }
    })?;
    let Sections { text, data, bss } = contents::sections(&built, ram.clone())?;
    fits(&name, "flash", text, flash)?;
    fits(&name, "RAM", data + bss, ram.end - ram.start)?;
    if let Some(block) = block {
        key_block::fill(&mut built, &block)?;
    }
    let is_secret = keys.link_key.is_some();
    for (format, path) in &outputs {
        save(path, &format.of(&built)?, is_secret)
            .map_err(|error| format!("{}: {error}", shown(path)))?;
    }

    println!("{} on {name}\n\n{wiring}", options.robot.display());
    for (key, what) in [
        (&keys.link_key, "accepts commands only from hosts with the link key of"),
        (&keys.library_key, "plays only libraries signed for"),
    ] {
        if let Some(path) = key {
            println!("{what} {}", path.display());
        }
    }
    println!("flash {text} B of {flash}, RAM {} B of {}", data + bss, ram.end - ram.start);
    for (format, path) in outputs {
        println!("\n{}", shown(&path));
        for (_, how) in flashing.iter().filter(|(flashed, _)| *flashed == format) {
            println!("  {}", how.replace("FILE", &shown(&path)));
        }
    }
    if is_secret {
        println!(
            "\nThese files contain the link key: keep the files as secret as the key, and lock the \
             chip's debug port (docs/threat-model.md)"
        );
    }
    Ok(())
}

/// Cargo features of the boards for the given keys.
fn features(keys: &KeyFiles) -> String {
    let features = [(&keys.link_key, "authenticated"), (&keys.library_key, "signed")];
    let wanted = features.into_iter().filter(|(key, _)| key.is_some()).map(|(_, feature)| feature);
    wanted.collect::<Vec<_>>().join(",")
}

/// Builds the image with blank keys, and checks that our own code cannot panic. The crate that checks signatures has index
/// checks that the compiler cannot remove (`docs/threat-model.md`, G5), so the check uses an image without it.
fn build(image: &Image, module: &Path, keys: &KeyFiles) -> Result<Vec<u8>, String> {
    let ours = if keys.link_key.is_some() { "authenticated" } else { "" };
    let built = contents::read(&image.build_for(module, ours)?)?;
    let panics = contents::panic_paths(&built)?;
    if !panics.is_empty() {
        return Err(format!("the image can panic: {}", panics.join(", ")));
    }
    match keys.library_key {
        Some(_) => contents::read(&image.build_for(module, &features(keys))?),
        None => Ok(built),
    }
}

/// Checks that an image fits into a memory of a board.
fn fits(board: &str, memory: &str, taken: u64, room: u64) -> Result<(), String> {
    if taken <= room {
        return Ok(());
    }
    Err(format!("the image takes {taken} B of {memory}, but {board} has only {room} B"))
}

/// Returns the files to write: the one that the user named, or one of each format.
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
        format!(
            "{}: name a file for an image of {board} with the ending {}",
            path.display(),
            endings.join(" or ")
        )
    })?;
    Ok(vec![(*format, path.clone())])
}

/// Writes a file in place, so that links and devices are kept. Only the user can read a file with a secret.
pub fn save(path: &Path, bytes: &[u8], is_secret: bool) -> io::Result<()> {
    if let Some(folder) = path.parent().filter(|folder| folder.starts_with(shell::target_folder()))
    {
        fs::create_dir_all(folder)?;
    }
    let mut options = OpenOptions::new();
    options.write(true).create(true).truncate(true);
    #[cfg(unix)]
    if is_secret {
        std::os::unix::fs::OpenOptionsExt::mode(&mut options, 0o600);
    }
    let mut file = options.open(path)?;
    // An existing file would keep its permissions.
    #[cfg(unix)]
    if is_secret && file.metadata()?.is_file() {
        file.set_permissions(std::os::unix::fs::PermissionsExt::from_mode(0o600))?;
    }
    file.write_all(bytes)
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
            keys: KeyFiles::default(),
        };
        let outputs_of = |board, output| {
            let options = options(board, output);
            outputs(&options, product(board).formats, "this board")
        };
        let of_file = outputs_of(Board::Pico2, Some("a/b.uf2"));
        assert_eq!(of_file, Ok(vec![(Format::Uf2(RP2350_ARM), "a/b.uf2".into())]));
        let why = outputs_of(Board::NucleoG474re, Some("b.uf2")).unwrap_err();
        assert_eq!(
            why,
            "b.uf2: name a file for an image of this board with the ending .elf or .bin"
        );
        assert!(outputs_of(Board::Mps2An386, Some("image")).is_err());

        let both = outputs_of(Board::NucleoG474re, None).unwrap();
        let names: Vec<_> = both.iter().map(|(_, path)| path.file_name().unwrap()).collect();
        assert_eq!(names, ["pup-this board.elf", "pup-this board.bin"]);
    }

    #[test]
    fn an_image_that_does_not_fit_says_by_how_much() {
        assert_eq!(fits("this board", "flash", 512, 512), Ok(()));
        let why = fits("this board", "flash", 513, 512).unwrap_err();
        assert_eq!(why, "the image takes 513 B of flash, but this board has only 512 B");
    }

    #[cfg(unix)]
    #[test]
    fn an_image_with_a_secret_is_for_its_user_alone() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("image.bin");
        let mode = || fs::metadata(&path).unwrap().permissions().mode() & 0o777;
        save(&path, b"no key", false).unwrap();
        fs::set_permissions(&path, fs::Permissions::from_mode(0o644)).unwrap();
        save(&path, b"key", true).unwrap();
        assert_eq!((fs::read(&path).unwrap(), mode()), (b"key".to_vec(), 0o600));
        fs::remove_file(&path).unwrap();
        save(&path, b"key", true).unwrap();
        assert_eq!(mode(), 0o600);
    }
}
