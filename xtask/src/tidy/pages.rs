//! Check of the pages for users: their length, and that tables of measurements are written by commands.

use crate::checkout::TextFile;
use crate::measured;

/// Maximum number of words in all pages, without code and without the pages that commands write.
const ALL: usize = 49_800;
/// Maximum number of words in one page, without code.
const PAGE: usize = 5_000;
/// Groups of pages, each with the maximum number of words of the whole group, including code.
const GROUPS: [(&[&str], usize); 3] = [
    (&["README.md"], 1_800),
    (&["CONTRIBUTING.md", "ARCHITECTURE.md"], 2_500),
    (&["CHANGELOG.md"], 600),
];

/// Pages that are too long, and measurements in pages for users.
pub fn violations(files: &[TextFile]) -> Vec<String> {
    let is_written = |file: &TextFile| file.path.starts_with(measured::FOLDER);
    let pages: Vec<_> =
        files.iter().filter(|file| file.path.ends_with(".md") && !is_written(file)).collect();
    let mut found = Vec::new();
    let mut check = |name: &str, words: usize, room: usize| {
        if words > room {
            found.push(format!(
                "{name}: {words} words; shorten the text to {room} words: cut, \
                merge or link"
            ));
        }
    };
    for page in &pages {
        check(&page.path, prose(&page.text), PAGE);
    }
    for (group, room) in GROUPS {
        let of_group = pages.iter().filter(|page| group.contains(&page.path.as_str()));
        let words =
            of_group.map(|page| page.text.split_whitespace().filter(|word| is_word(word)).count());
        check(&group.join(" and "), words.sum(), room);
    }
    check("all pages", pages.iter().map(|page| prose(&page.text)).sum(), ALL);
    let users =
        pages.iter().filter(|page| page.path.starts_with("docs/") || page.path == "README.md");
    for page in users {
        found.extend(measurements(page));
    }
    found
}

/// Number of words outside of code blocks.
fn prose(text: &str) -> usize {
    let mut in_code = false;
    let mut count = 0;
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            in_code = !in_code;
        } else if !in_code {
            count += line.split_whitespace().filter(|word| is_word(word)).count();
        }
    }
    count
}

fn is_word(word: &str) -> bool {
    word.contains(|c: char| c.is_ascii_alphabetic())
}

/// Tables of a page in which most cells are decimals.
fn measurements(page: &TextFile) -> Vec<String> {
    let mut found = Vec::new();
    let mut table: Vec<(usize, &str)> = Vec::new();
    for (number, line) in page.text.lines().chain([""]).enumerate() {
        if line.starts_with('|') {
            table.push((number + 1, line));
            continue;
        }
        // Below the heading, without the names of the rows.
        let rows = table.iter().skip(2).map(|(_, row)| row.trim_matches('|').split('|').skip(1));
        let cells: Vec<_> = rows.flatten().map(str::trim).filter(|cell| !cell.is_empty()).collect();
        let decimals = cells.iter().filter(|cell| is_decimal(cell)).count();
        if table.len() > 4 && 2 * decimals > cells.len() {
            let line = table[0].0;
            let folder = measured::FOLDER;
            let instead =
                format!("write tables of measurements into {folder} with `cargo xtask measured`");
            found.push(format!("{}:{line}: {instead}", page.path));
        }
        table.clear();
    }
    found
}

fn is_decimal(cell: &str) -> bool {
    let digits =
        cell.trim_start_matches(['-', '−', '*', '`']).trim_end_matches(['%', '*', '`', ' ']);
    digits.contains('.') && digits.parse::<f64>().is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::checkout::file;

    #[test]
    fn long_pages_are_named_and_code_is_not_counted() {
        let words = |n: usize| "word ".repeat(n);
        let files = [
            file("docs/a.md", &words(PAGE + 1)),
            file("docs/b.md", &format!("```text\n{}\n```\n{}", words(PAGE), words(PAGE))),
            file("README.md", &format!("```\n{}\n```\n", words(1_801))),
            file("docs/measured/c.md", &words(2 * PAGE)),
        ];
        let found = violations(&files);
        assert_eq!(found.len(), 2, "{found:?}");
        assert!(found[0].starts_with("docs/a.md: 5001 words"), "{found:?}");
        assert!(found[1].starts_with("README.md: 1801 words"), "{found:?}");
    }

    #[test]
    fn tables_of_decimals_are_measurements() {
        let rows = "| a | 1.20 | 3.4 % |\n".repeat(4);
        let table = format!("| motion | time | error |\n|---|---|---|\n{rows}");
        let limits = "| a | 1.5 m | 3 |\n".repeat(9);
        let files = [
            file("docs/a.md", &format!("x\n\n{table}")),
            file("docs/b.md", &limits),
            file("docs/measured/a.md", &table),
        ];
        let found = violations(&files);
        assert_eq!(found.len(), 1, "{found:?}");
        assert!(found[0].starts_with("docs/a.md:3:"), "{found:?}");
    }
}
