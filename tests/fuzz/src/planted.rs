//! A bug that only a fuzzer with eyes finds: behind a word of four letters, which random bytes hit once
//! in four billion inputs, and coverage letter by letter. If it is not found, the others find nothing either.

/// Reads a "header": keyword, and how many bytes follow. Believes the count.
fn payload(data: &[u8]) -> &[u8] {
    let mut rest = data;
    for letter in *b"roll" {
        match rest.split_first() {
            Some((&first, behind)) if first == letter => rest = behind,
            _ => return &[],
        }
    }
    match rest {
        // The planted bug: the count is not compared with what is there.
        [count, behind @ ..] => &behind[..usize::from(*count)],
        [] => &[],
    }
}

/// Panics on some inputs.
pub fn run(data: &[u8]) {
    std::hint::black_box(payload(data));
}

/// Seed bytes without any part of the keyword.
pub fn seeds() -> Vec<Vec<u8>> {
    vec![vec![0; 12]]
}
