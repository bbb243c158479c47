//! RCPSP/max problems in ProGen/max's `.sch` format, as problems of a built-in model.
//!
//! Such a project has activities of fixed durations that use renewable resources, and bounds
//! between the starts of activities (K. Neumann, C. Schwindt and J. Zimmermann, *Project Scheduling
//! with Time Windows and Scarce Resources*, 2003). A file's first line is `n m 0 0`: how many
//! activities and resources there are. Then come n + 2 lines `id 1 k successors... [lags]...`, the
//! first and the last of which are the project's start and end; n + 2 lines `id 1 duration
//! demands...`; and a line with the capacities. A lag says that a successor starts so many ticks
//! after the activity, or later; a negative one that the *activity* starts at most so many ticks
//! after the successor.
//!
//! The model has a timeline `project.activities` on which a token
//! `Activity(number, demand_1, ...)` uses each `project.resource_k`. All activities are mandatory
//! goals `activity_1`, `activity_2`, ..., and the lags are orders of goals. The project's end is a
//! goal `end` only where lags say more of it than that activities are over.
//!
//! ```
//! let text = "2 1 0 0
//! 0 1 2 1 2 [0] [0]
//! 1 1 1 2 [4]
//! 2 1 2 3 1 [2] [-6]
//! 3 1 0
//! 0 1 0 0
//! 1 1 3 2
//! 2 1 2 1
//! 3 1 0 0
//! 2
//! ";
//! let (model, problem) = farside_planning::sch::read("two.sch", text.as_bytes())?;
//! assert_eq!(model.resources[0].name, "project.resource_1");
//! assert_eq!(problem.goals.len(), 2);
//! assert_eq!(problem.orders.len(), 2);
//! let error = farside_planning::sch::read("two.sch", text.replace("[4]", "4").as_bytes());
//! let error = error.unwrap_err().to_string();
//! assert_eq!(error, "line 3: \"4\" stands where a lag should, as in [4]");
//! # Ok::<(), farside_planning::sch::SchError>(())
//! ```

mod build;
#[cfg(test)]
mod tests;

use crate::Ticks;
use crate::model::{Model, Problem};

/// The most bytes of a file that are read.
pub const MAX_FILE_BYTES: usize = 4 << 20;

/// The most activities, without the project's start and end.
pub const MAX_ACTIVITIES: usize = 10_000;

/// The most resources.
pub const MAX_RESOURCES: usize = 100;

/// The greatest duration, demand, capacity and lag.
pub const GREATEST: i64 = 1_000_000_000;

/// Why a text is no project.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum SchError {
    /// The file is too large.
    #[error("the file has {actual_bytes} bytes; at most {MAX_FILE_BYTES} are read")]
    TooLarge {
        /// How many bytes it has.
        actual_bytes: usize,
    },
    /// Something is wrong in a line.
    #[error("line {line}: {problem}")]
    Line {
        /// The line, from 1.
        line: usize,
        /// What is wrong.
        problem: String,
    },
}

/// Reads a project. `name` is the file's, and what the model and the problem are called.
///
/// # Errors
///
/// With the line if the text does not have the format, or numbers beyond this module's limits.
pub fn read(name: &str, bytes: &[u8]) -> Result<(Model, Problem), SchError> {
    if bytes.len() > MAX_FILE_BYTES {
        return Err(SchError::TooLarge {
            actual_bytes: bytes.len(),
        });
    }
    let project = Project::read(bytes)?;
    Ok((build::model(name, &project), build::problem(name, &project)))
}

/// What a file says.
#[derive(Debug)]
struct Project {
    /// The project's start, the activities, the project's end.
    activities: Vec<Activity>,
    capacities: Vec<i64>,
    /// The line of the capacities.
    capacities_line: u32,
}

#[derive(Debug)]
struct Activity {
    duration: Ticks,
    demands: Vec<i64>,
    /// What starts at least so many ticks later.
    successors: Vec<(usize, Ticks)>,
    /// The line of the successors.
    successors_line: u32,
    /// The line of the duration and demands.
    line: u32,
}

impl Project {
    fn read(bytes: &[u8]) -> Result<Project, SchError> {
        let mut lines = Lines { bytes, line: 0 };
        let mut first = lines.next("the numbers of activities and of resources")?;
        let count = first.number("the number of activities", 0..=MAX_ACTIVITIES as i64)? as usize;
        let resources = first.number("the number of resources", 0..=MAX_RESOURCES as i64)? as usize;
        // Others of the family have non-renewable and doubly constrained resources: none here.
        while first.any() {
            first.number("0, since all resources are renewable", 0..=0)?;
        }
        let last = count + 1;
        let mut activities = Vec::new();
        for id in 0..=last {
            let mut words = lines.next("an activity's successors")?;
            words.starts_with(id)?;
            let many = words.number("the number of successors", 0..=last as i64)? as usize;
            let mut successors = Vec::new();
            for _ in 0..many {
                let to = words.number("a successor", 0..=last as i64)? as usize;
                if to == id {
                    return Err(words.error(format!("activity {id} is its own successor")));
                }
                successors.push((to, 0));
            }
            for (_, lag) in &mut successors {
                *lag = words.lag()?;
            }
            words.ends()?;
            activities.push(Activity {
                duration: 0,
                demands: Vec::new(),
                successors,
                successors_line: words.line as u32,
                line: 0,
            });
        }
        for (id, activity) in activities.iter_mut().enumerate() {
            let mut words = lines.next("an activity's duration and demands")?;
            words.starts_with(id)?;
            activity.line = words.line as u32;
            // The project's start and end are points in time.
            let most = if id == 0 || id == last { 0 } else { GREATEST };
            activity.duration = words.number("the duration", 0..=most)?;
            for _ in 0..resources {
                activity.demands.push(words.number("a demand", 0..=most)?);
            }
            words.ends()?;
        }
        let mut words = lines.next("the capacities")?;
        let capacities_line = words.line as u32;
        let mut capacities = Vec::new();
        for _ in 0..resources {
            capacities.push(words.number("a capacity", 0..=GREATEST)?);
        }
        words.ends()?;
        lines.end()?;
        Ok(Project {
            activities,
            capacities,
            capacities_line,
        })
    }
}

/// The lines of a file that are not blank.
struct Lines<'a> {
    bytes: &'a [u8],
    /// How many have been read.
    line: usize,
}

impl<'a> Lines<'a> {
    /// The next line, which should have `what`.
    fn next(&mut self, what: &str) -> Result<Words<'a>, SchError> {
        match self.any()? {
            Some(words) => Ok(words),
            None => Err(SchError::Line {
                line: self.line.max(1),
                problem: format!("the file ends here, before {what}"),
            }),
        }
    }

    /// That there are no more lines.
    fn end(&mut self) -> Result<(), SchError> {
        match self.any()? {
            None => Ok(()),
            Some(words) => Err(words.error("the project is over before this line".to_owned())),
        }
    }

    fn any(&mut self) -> Result<Option<Words<'a>>, SchError> {
        while !self.bytes.is_empty() {
            let end = self.bytes.iter().position(|&byte| byte == b'\n');
            let (line, rest) = match end {
                Some(end) => (&self.bytes[..end], &self.bytes[end + 1..]),
                None => (self.bytes, &[][..]),
            };
            self.bytes = rest;
            self.line += 1;
            let text = std::str::from_utf8(line).map_err(|_| SchError::Line {
                line: self.line,
                problem: "it is no text".to_owned(),
            })?;
            if !text.trim().is_empty() {
                return Ok(Some(Words {
                    words: text.split_whitespace(),
                    line: self.line,
                }));
            }
        }
        Ok(None)
    }
}

/// The words of a line.
struct Words<'a> {
    words: std::str::SplitWhitespace<'a>,
    line: usize,
}

impl Words<'_> {
    fn any(&self) -> bool {
        self.words.clone().next().is_some()
    }

    /// A number within limits.
    fn number(
        &mut self,
        what: &str,
        limits: std::ops::RangeInclusive<i64>,
    ) -> Result<i64, SchError> {
        let Some(word) = self.words.next() else {
            return Err(self.error(format!("it ends before {what}")));
        };
        let number = word.parse::<i64>().ok();
        number
            .filter(|number| limits.contains(number))
            .ok_or_else(|| {
                let (from, to) = limits.into_inner();
                let word = shown(word);
                self.error(format!(
                    "{word:?} stands where {what} should, {from} to {to}"
                ))
            })
    }

    /// A number in brackets.
    fn lag(&mut self) -> Result<i64, SchError> {
        let Some(word) = self.words.next() else {
            return Err(self.error("it ends before the lag of each successor".to_owned()));
        };
        let inner = word
            .strip_prefix('[')
            .and_then(|word| word.strip_suffix(']'));
        let lag = inner.and_then(|inner| inner.parse::<i64>().ok());
        lag.filter(|lag| (-GREATEST..=GREATEST).contains(lag))
            .ok_or_else(|| {
                let word = shown(word);
                self.error(format!("{word:?} stands where a lag should, as in [4]"))
            })
    }

    /// The number of an activity, and its only mode.
    fn starts_with(&mut self, id: usize) -> Result<(), SchError> {
        let id = id as i64;
        self.number("the activity's number", id..=id)?;
        self.number("the activity's only mode", 1..=1)?;
        Ok(())
    }

    fn ends(&mut self) -> Result<(), SchError> {
        match self.words.next() {
            None => Ok(()),
            Some(word) => {
                let word = shown(word);
                Err(self.error(format!("{word:?} is more than the line should have")))
            }
        }
    }

    fn error(&self, problem: String) -> SchError {
        SchError::Line {
            line: self.line,
            problem,
        }
    }
}

/// A word, or its beginning.
fn shown(word: &str) -> String {
    const LONGEST: usize = 40;
    match word.chars().nth(LONGEST) {
        None => word.to_owned(),
        Some(_) => word.chars().take(LONGEST).chain(['…']).collect(),
    }
}
