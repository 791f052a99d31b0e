//! Journals of sweeps: a line for the sweep, then one for every chain that is done. What has been written is not lost, and a
//! line that was torn by the end of a run is left out.

use super::Row;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// First line of a journal.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Header {
    /// Name of the sweep.
    pub sweep: String,
    /// Digest of the sweep and all files that it names.
    pub digest: String,
    /// Version of the program: another one may plan differently.
    pub version: String,
    /// Number of chains.
    pub chains: usize,
    /// Names of the axes.
    pub axes: Vec<String>,
}

/// A chain that is done.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Chain {
    /// Its number.
    pub chain: usize,
    /// Its rows.
    pub rows: Vec<Row>,
}

/// What a journal has.
#[derive(Clone, Debug, PartialEq)]
pub struct Journal {
    /// The sweep that it is of.
    pub header: Header,
    /// Rows of the chains that are done.
    pub chains: BTreeMap<usize, Vec<Row>>,
    /// Length of the lines that are whole, bytes.
    pub whole: usize,
}

/// A line of a journal.
///
/// # Panics
/// Never: numbers, texts and lists become JSON.
pub fn line(value: &impl Serialize) -> String {
    serde_json::to_string(value).expect("rows become JSON") + "\n"
}

impl Journal {
    /// Reads a journal; `None` if its first line is none of a journal.
    pub fn read(text: &str) -> Option<Self> {
        let mut lines = text.split_inclusive('\n').filter(|line| line.ends_with('\n'));
        let first = lines.next()?;
        let header = serde_json::from_str(first).ok()?;
        let mut journal = Self { header, chains: BTreeMap::new(), whole: first.len() };
        for line in lines {
            let Ok(Chain { chain, rows }) = serde_json::from_str(line) else { break };
            journal.chains.insert(chain, rows);
            journal.whole += line.len();
        }
        Some(journal)
    }

    /// Adds the chains of another journal of the same sweep.
    pub fn merge(&mut self, other: Self) {
        self.chains.extend(other.chains);
    }

    /// Chains that are not done.
    pub fn missing(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.header.chains).filter(|chain| !self.chains.contains_key(chain))
    }

    /// All rows in the order of their points.
    pub fn rows(&self) -> impl Iterator<Item = &Row> {
        self.chains.values().flatten()
    }
}
