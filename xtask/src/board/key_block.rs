//! Key block of a program that was compiled without keys; `firmware/boards/image_keys.rs` reads it at startup.

use object::{Object, ObjectSection, ObjectSymbol};
use std::ops::Range;

/// Symbol of the block.
const SYMBOL: &str = "ROLLWALK_KEYS";
/// First bytes of the block, blank or filled.
const MAGIC: &[u8] = b"RW-KEYS1";

/// Replaces the blank key block of a program by a block in hexadecimal digits.
///
/// # Errors
/// Returns an error if the program does not have a blank block of this size.
pub fn fill(image: &mut [u8], digits: &str) -> Result<(), String> {
    let block = bytes(digits).ok_or("the bench wrote no valid key block")?;
    let place = block_range(image)?;
    let blank = image.get_mut(place).filter(|place| place.len() == block.len());
    let blank = blank.ok_or("the program has room for a key block of another version")?;
    let (magic, rest) = blank.split_at(MAGIC.len().min(blank.len()));
    if magic != MAGIC || rest.iter().any(|&byte| byte != 0) {
        return Err("the program already has keys".into());
    }
    blank.copy_from_slice(&block);
    Ok(())
}

/// Returns the position of the block in the file of a program.
fn block_range(image: &[u8]) -> Result<Range<usize>, String> {
    let file = object::File::parse(image).map_err(|error| format!("the image: {error}"))?;
    let found = file.symbols().find(|symbol| symbol.name() == Ok(SYMBOL));
    let place = found.and_then(|symbol| {
        let section = file.section_by_index(symbol.section_index()?).ok()?;
        let (start, size) = section.file_range()?;
        let offset = symbol.address().checked_sub(section.address())?;
        let within = offset.checked_add(symbol.size())? <= size;
        let from = usize::try_from(start.checked_add(offset)?).ok()?;
        within.then_some(from..from.checked_add(usize::try_from(symbol.size()).ok()?)?)
    });
    place.ok_or_else(|| format!("the program lacks {SYMBOL}, because it was built without keys"))
}

fn bytes(digits: &str) -> Option<Vec<u8>> {
    let pairs = digits.as_bytes().chunks(2).map(|pair| std::str::from_utf8(pair).ok());
    let byte =
        |pair: Option<&str>| u8::from_str_radix(pair.filter(|pair| pair.len() == 2)?, 16).ok();
    pairs.map(byte).collect()
}
