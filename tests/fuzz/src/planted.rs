//! Deliberate bug that only a fuzzer with coverage feedback finds. It is behind a keyword of four letters. Random bytes match
//! the keyword once in four billion inputs, but coverage feedback finds it letter by letter. A fuzzer that does not find this
//! bug would not find others.

/// Reads a "header", a keyword and the number of bytes that follow. Does not check this number.
fn payload(data: &[u8]) -> &[u8] {
    let mut rest = data;
    for letter in *b"roll" {
        match rest.split_first() {
            Some((&first, behind)) if first == letter => rest = behind,
            _ => return &[],
        }
    }
    match rest {
        // Planted bug: the count is not compared with the number of bytes.
        [count, behind @ ..] => &behind[..usize::from(*count)],
        [] => &[],
    }
}

/// Panics on some inputs.
pub fn run(data: &[u8]) {
    std::hint::black_box(payload(data));
}

/// Seed without any letter of the keyword.
pub fn seeds() -> Vec<Vec<u8>> {
    vec![vec![0; 12]]
}
