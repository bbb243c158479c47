//! What plans of known problems are worth at the most, as other programs have proved: tables of bounds by the
//! problem's digest. `experiments/oracles/misus_bound.py --table FILE` writes them.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use serde::Deserialize;
use thiserror::Error;

/// The bounds that are built in.
const BUILTIN: &str = include_str!("../../bounds.csv");

/// What is wrong with a table.
#[derive(Debug, Error)]
pub enum BoundsError {
    /// It is no table of values separated by commas with columns `digest` and `bound`.
    #[error("expected a table with columns digest and bound: {0}")]
    Table(#[from] csv::Error),
    /// A digest that is none.
    #[error("line {line}: digest {found:?}: expected 32 hexadecimal digits")]
    Digest {
        /// The line, from 1.
        line: u64,
        /// What stands there.
        found: String,
    },
    /// A bound that is no finite number.
    #[error("line {line}: bound {found}: expected a finite number")]
    Bound {
        /// The line, from 1.
        line: u64,
        /// What stands there.
        found: f64,
    },
}

/// A line of a table. Other columns are for people.
#[derive(Deserialize)]
struct Row {
    digest: String,
    bound: f64,
}

/// Bounds by the digest of the problem ([`Problem::digest`](super::problem::Problem::digest)).
///
/// ```
/// use farside_misus::planner::bounds::Bounds;
/// let digest = "000102030405060708090a0b0c0d0e0f";
/// let text = format!("digest,bound,problem\n{digest},489,\"seed 3, 6 rocks\"\n{digest},512.5,\n");
/// let bounds = Bounds::parse(&text)?;
/// assert_eq!(bounds.of(digest), Some(489.0));
/// assert_eq!(bounds.of("0"), None);
/// let wrong = Bounds::parse("digest,bound\n1,2\n").unwrap_err().to_string();
/// assert_eq!(wrong, "line 2: digest \"1\": expected 32 hexadecimal digits");
/// # Ok::<(), farside_misus::planner::bounds::BoundsError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bounds(BTreeMap<String, f64>);

impl Bounds {
    /// Reads a table: values separated by commas, names of columns first. Of two bounds for one problem the
    /// lesser holds.
    ///
    /// # Errors
    /// When a line is none of such a table, with its number.
    pub fn parse(text: &str) -> Result<Bounds, BoundsError> {
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        let headers = reader.headers()?.clone();
        let mut bounds = BTreeMap::new();
        let mut record = csv::StringRecord::new();
        while reader.read_record(&mut record)? {
            let line = record.position().map_or(0, csv::Position::line);
            let row: Row = record.deserialize(Some(&headers))?;
            let digest = row.digest.to_ascii_lowercase();
            if digest.len() != 32 || !digest.bytes().all(|byte| byte.is_ascii_hexdigit()) {
                let found = row.digest;
                return Err(BoundsError::Digest { line, found });
            }
            if !row.bound.is_finite() {
                let found = row.bound;
                return Err(BoundsError::Bound { line, found });
            }
            let least = bounds.entry(digest).or_insert(row.bound);
            *least = row.bound.min(*least);
        }
        Ok(Bounds(bounds))
    }

    /// The bounds that are built in: of problems that `misus/planners` draws.
    ///
    /// # Panics
    /// Never: a test reads them.
    pub fn builtin() -> &'static Bounds {
        static PARSED: OnceLock<Bounds> = OnceLock::new();
        PARSED.get_or_init(|| Bounds::parse(BUILTIN).expect("the table that is built in is right"))
    }

    /// What a plan of a problem is worth at the most, if that is known.
    pub fn of(&self, digest: &str) -> Option<f64> {
        self.0.get(digest).copied()
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn the_table_that_is_built_in_is_right() {
        assert!(Bounds::builtin().0.len() >= 5);
    }

    #[test]
    fn what_is_wrong_is_said_with_its_line() {
        let digest = "0".repeat(32);
        for (text, expected) in [
            ("digest,worth\na,1\n".to_owned(), "columns digest and bound"),
            (format!("digest,bound\n{digest}\n"), "line: 2"),
            (format!("digest,bound\n{digest},nan\n"), "line 2: bound NaN"),
            (format!("digest,bound\n{digest},much\n"), "line: 2"),
            ("bound,digest\n1,xyz\n".to_owned(), "line 2: digest \"xyz\""),
        ] {
            let said = Bounds::parse(&text).unwrap_err().to_string();
            assert!(said.contains(expected), "{text}: {said}");
        }
    }

    proptest! {
        #[test]
        fn any_text_is_read_or_refused(text in "(digest|bound|[0-9a-f]{32}|[-0-9.e,\"#\n]){0,20}") {
            if let Ok(bounds) = Bounds::parse(&text) {
                prop_assert!(bounds.0.values().all(|bound| bound.is_finite()));
            }
        }
    }
}
