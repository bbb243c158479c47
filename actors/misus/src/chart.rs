//! What pictures of MISUS's systems are drawn from that show the same of different runs: curves over a common axis,
//! areas on top of each other, nights, marks of observations, and what is said when there is nothing to show.

pub(crate) mod marks;
pub(crate) mod nights;
pub(crate) mod stacked;
pub(crate) mod strip;

use farside::SimDuration;
use farside_actors::system::{PictureError, PictureRequest, Recording};

/// Rules for the classes that are drawn with here.
pub(crate) const STYLE: &str = include_str!("chart/chart.css");

/// Why there is nothing to draw: what the recording lacks, and of which kind of sample it would be made.
pub(crate) fn nothing(run: &dyn Recording, what: &str, kind: &str) -> PictureError {
    let excluded = match run.excluded() {
        [] => String::new(),
        left_out => format!("; left out of it were {}", left_out.join(", ")),
    };
    PictureError::NotDrawn(format!(
        "it holds {what}: expected samples of {kind}{excluded}"
    ))
}

/// A time within a run that ended at `end_ns`; its end unless given.
pub(crate) fn time_ns(end_ns: u64, at: Option<SimDuration>) -> Result<u64, PictureError> {
    let end = SimDuration::from_nanos(end_ns);
    match at {
        None => Ok(end_ns),
        Some(at) if at > end => Err(PictureError::NotDrawn(format!(
            "at {at}: the run ended at {end}"
        ))),
        Some(at) => Ok(at.as_nanos()),
    }
}

/// From when to when a picture of a run that ended at `end_ns` is asked to be.
pub(crate) fn span_ns(end_ns: u64, request: &PictureRequest) -> Result<(u64, u64), PictureError> {
    let from = request.from.unwrap_or(SimDuration::ZERO);
    let (from_ns, to_ns) = (time_ns(end_ns, Some(from))?, time_ns(end_ns, request.at)?);
    if from_ns < to_ns {
        return Ok((from_ns, to_ns));
    }
    let to = SimDuration::from_nanos(to_ns);
    let message = format!("from {from} to {to}: expected a time span");
    Err(PictureError::NotDrawn(message))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_span_ends_with_the_run_and_has_a_length() {
        let span = |from: Option<u64>, at: Option<u64>| {
            let request = PictureRequest {
                from: from.map(SimDuration::from_nanos),
                at: at.map(SimDuration::from_nanos),
                ..PictureRequest::default()
            };
            span_ns(10, &request).map_err(|error| error.to_string())
        };
        assert_eq!(span(None, None), Ok((0, 10)));
        assert_eq!(span(Some(3), Some(7)), Ok((3, 7)));
        assert!(span(Some(7), Some(7)).is_err_and(|error| error.contains("expected a time span")));
        assert!(span(Some(11), None).is_err_and(|error| error.contains("the run ended at")));
        assert!(span(None, Some(11)).is_err_and(|error| error.contains("the run ended at")));
    }
}
