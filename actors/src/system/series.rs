//! Series: metrics that are curves over an index, as a reward over the steps of an optimiser.

use serde::{Deserialize, Serialize};
use serde_json::Value;
use thiserror::Error;

/// A curve that a run reports under a metric's name: a value, or none, at each index. In a run's
/// results it is JSON as every metric is: `{"index": [0, 1], "values": [0.5, null]}`.
///
/// ```
/// use farside_actors::system::{Results, Series};
/// let mut results = Results::default();
/// let reward = Series::new(vec![0.0, 1.0, 2.0], vec![Some(0.1), None, Some(0.7)])?;
/// assert_eq!((reward.at(2.0), reward.at(1.0)), (Some(0.7), None));
/// results.metrics.insert("reward".to_owned(), reward.into());
/// assert_eq!(results.metrics["reward"]["values"][2], 0.7);
/// # Ok::<(), farside_actors::system::SeriesError>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Parts")]
pub struct Series {
    index: Vec<f64>,
    values: Vec<Option<f64>>,
}

/// Why some numbers are no series.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum SeriesError {
    /// There are more of one than of the other.
    #[error("{indices} indices and {values} values: expected as many of both")]
    Lengths {
        /// How many indices.
        indices: usize,
        /// How many values.
        values: usize,
    },
    /// An index that is none, or does not come after the one before it.
    #[error("index {found} at place {place}: expected finite numbers that rise")]
    Index {
        /// The place, from 0.
        place: usize,
        /// What is there.
        found: f64,
    },
}

/// What is written of a series.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Parts {
    index: Vec<f64>,
    values: Vec<Option<f64>>,
}

impl TryFrom<Parts> for Series {
    type Error = SeriesError;

    fn try_from(parts: Parts) -> Result<Self, SeriesError> {
        Series::new(parts.index, parts.values)
    }
}

impl Series {
    /// A curve over 0, 1, 2 and so on, with a value at each.
    ///
    /// ```
    /// use farside_actors::system::Series;
    /// assert_eq!(Series::counted([0.5, 0.7]).at(1.0), Some(0.7));
    /// ```
    pub fn counted(values: impl IntoIterator<Item = f64>) -> Series {
        let values: Vec<Option<f64>> = values.into_iter().map(Some).collect();
        let index = (0..values.len()).map(|index| index as f64).collect();
        Series { index, values }
    }

    /// A series. A value that is no finite number counts as none.
    ///
    /// # Errors
    /// When there are not as many of both, or the indices do not rise.
    pub fn new(index: Vec<f64>, values: Vec<Option<f64>>) -> Result<Self, SeriesError> {
        if index.len() != values.len() {
            let (indices, values) = (index.len(), values.len());
            return Err(SeriesError::Lengths { indices, values });
        }
        // A minus zero and a zero are one index.
        let index: Vec<f64> = index.into_iter().map(|at| at + 0.0).collect();
        let rises = |place: &usize| {
            let before = place.checked_sub(1).map(|before| index[before]);
            index[*place].is_finite() && before.is_none_or(|before| before < index[*place])
        };
        if let Some(place) = (0..index.len()).find(|place| !rises(place)) {
            let found = index[place];
            return Err(SeriesError::Index { place, found });
        }
        let finite = |value: Option<f64>| value.filter(|value| value.is_finite());
        let values = values.into_iter().map(finite).collect();
        Ok(Series { index, values })
    }

    /// A run's series from its results.
    ///
    /// # Errors
    /// When it is no series, in words.
    pub fn from_json(value: &Value) -> Result<Self, String> {
        Series::deserialize(value).map_err(|error| error.to_string())
    }

    /// The indices, which rise.
    pub fn index(&self) -> &[f64] {
        &self.index
    }

    /// The value at an index; none if there is none, or no such index.
    pub fn at(&self, index: f64) -> Option<f64> {
        let place = self.index.binary_search_by(|at| at.total_cmp(&index));
        self.values[place.ok()?]
    }
}

impl From<Series> for Value {
    fn from(series: Series) -> Value {
        serde_json::json!({ "index": series.index, "values": series.values })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_series_is_refused() {
        let said = |text: &str| {
            let value: Value = serde_json::from_str(text).unwrap();
            Series::from_json(&value).unwrap_err()
        };
        for (text, holds) in [
            (
                r#"{"index": [0, 1], "values": [2]}"#,
                "2 indices and 1 values",
            ),
            (
                r#"{"index": [0, 0], "values": [2, 3]}"#,
                "index 0 at place 1",
            ),
            (r#"{"index": [0]}"#, "missing field `values`"),
            (r#"{"index": [0], "values": ["x"]}"#, "invalid type"),
            (r#"{"x": 1}"#, "unknown field `x`"),
        ] {
            let message = said(text);
            assert!(message.contains(holds), "{text}: {message}");
        }
        assert!(Series::new(vec![f64::NAN], vec![None]).is_err());
    }

    #[test]
    fn json_and_back() {
        let series = Series::new(
            vec![-0.0, 0.1, 2.5e300],
            vec![Some(f64::NAN), Some(0.1 + 0.2), None],
        );
        let series = series.unwrap();
        let text = Value::from(series.clone()).to_string();
        assert_eq!(
            text,
            r#"{"index":[0.0,0.1,2.5e+300],"values":[null,0.30000000000000004,null]}"#
        );
        assert_eq!(
            Series::from_json(&serde_json::from_str(&text).unwrap()),
            Ok(series)
        );
    }
}
