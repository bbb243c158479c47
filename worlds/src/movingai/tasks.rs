//! Tasks: the lines of a `.scen` file.

use std::fmt::Write;

use super::error::{GridError, GridProblem};
use super::map::Lines;
use super::{Cell, MAX_TASKS, text_of, whole};
use crate::contacts::shown;

const FORM: &str =
    "bucket map width height start-x start-y goal-x goal-y optimal-length, with tabs between";

const NUMBER: &str = "a whole number from 0 to 4294967295";

/// One line of a `.scen` file: where a rover starts, and where it shall go and stay.
#[derive(Clone, Debug, PartialEq)]
pub struct GridTask {
    /// The line of the file that it stands on, from 1.
    pub line: usize,
    /// Tasks of about the same length: the length over 4, rounded down, in the published files.
    pub bucket: u32,
    /// The map's file name, perhaps after folders.
    pub map: String,
    /// The map's width and height in cells.
    pub size: (u32, u32),
    /// Where it begins.
    pub start: Cell,
    /// Where it ends.
    pub goal: Cell,
    /// The length of a shortest path in cells as published, with diagonal steps that cut no
    /// corners: see [`super::GridMap::octile_length`]. It is not checked against the map.
    pub optimal_length: f64,
}

/// The tasks of a `.scen` file, in its order. What they say about a map is checked once there is
/// one, by [`super::GridWorld::new`].
///
/// ```
/// use farside_worlds::movingai::{Cell, TaskList};
/// let text = "version 1\n3\trubble.map\t32\t32\t11\t6\t7\t18\t13.65685425\n";
/// let tasks = TaskList::from_movingai(text.as_bytes())?;
/// let task = &tasks.first(1)?[0];
/// assert_eq!((task.line, task.start, task.goal), (2, Cell { x: 11, y: 6 }, Cell { x: 7, y: 18 }));
/// assert_eq!(task.optimal_length, 13.65685425);
/// assert_eq!(tasks.to_movingai(), text);
/// # Ok::<(), farside_worlds::movingai::GridError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct TaskList {
    tasks: Vec<GridTask>,
}

impl TaskList {
    /// Reads a `.scen` file: `version 1`, then on each line bucket, map, width, height, start x and
    /// y, goal x and y, and optimal length, with tabs between them (or other white space, on a line
    /// without tabs). Blank lines are let pass. There may be no task at all.
    ///
    /// ```
    /// use farside_worlds::movingai::TaskList;
    /// let text = "version 1\n0\ta.map\t8\t8\t1\t1\t-3\t1\t2\n";
    /// let error = TaskList::from_movingai(text.as_bytes()).unwrap_err();
    /// assert_eq!(
    ///     error.to_string(),
    ///     "line 2, column 17: goal x \"-3\": expected a whole number from 0 to 4294967295"
    /// );
    /// ```
    ///
    /// # Errors
    /// With line and column, when the text is no such file or has more than [`MAX_TASKS`] tasks; or
    /// when the file has more than [`super::MAX_FILE_BYTES`].
    pub fn from_movingai(bytes: &[u8]) -> Result<TaskList, GridError> {
        let mut lines = Lines::new(text_of(bytes)?);
        let (line, text) = lines.next(|| "`version 1`".to_owned())?;
        let words: Vec<&str> = text.split_whitespace().take(3).collect();
        if !matches!(words[..], ["version", "1" | "1.0"]) {
            let (found, expected) = (shown(text), "`version 1`");
            return Err(GridError::at(line, GridProblem::Header { found, expected }));
        }
        let mut tasks = Vec::new();
        while let Some((line, text)) = lines.more() {
            if text.trim().is_empty() {
                continue;
            }
            if tasks.len() == MAX_TASKS {
                let limit = MAX_TASKS;
                return Err(GridError::at(line, GridProblem::TooManyTasks { limit }));
            }
            tasks.push(read_task(line, text)?);
        }
        Ok(TaskList { tasks })
    }

    /// These tasks, whose lines are counted anew.
    pub(super) fn of(mut tasks: Vec<GridTask>) -> TaskList {
        for (task, line) in tasks.iter_mut().zip(2..) {
            task.line = line;
        }
        TaskList { tasks }
    }

    /// The tasks as a `.scen` file, which [`TaskList::from_movingai`] reads back to equal ones, but
    /// for the lines they stand on if there were blank ones.
    pub fn to_movingai(&self) -> String {
        let mut text = "version 1\n".to_owned();
        for task in &self.tasks {
            let (bucket, map, (width, height)) = (task.bucket, &task.map, task.size);
            let (start, goal, length) = (task.start, task.goal, task.optimal_length);
            writeln!(
                text,
                "{bucket}\t{map}\t{width}\t{height}\t{}\t{}\t{}\t{}\t{length}",
                start.x, start.y, goal.x, goal.y
            )
            .expect("a String takes any text");
        }
        text
    }

    /// All tasks.
    pub fn tasks(&self) -> &[GridTask] {
        &self.tasks
    }

    /// The first `count` tasks: one for each rover, as published solvers take them.
    ///
    /// # Errors
    /// When there are fewer.
    pub fn first(&self, count: usize) -> Result<&[GridTask], GridError> {
        self.tasks.get(..count).ok_or(GridError::TooFewTasks {
            wanted: count,
            found: self.tasks.len(),
        })
    }
}

fn read_task(line: usize, text: &str) -> Result<GridTask, GridError> {
    let mut fields = Fields { line, text, at: 0 };
    let bucket = fields.number("bucket")?;
    let map = fields.name("map")?;
    let size = (fields.number("map width")?, fields.number("map height")?);
    let mut cell = |x, y| -> Result<Cell, GridError> {
        let x = fields.number(x)?;
        let y = fields.number(y)?;
        Ok(Cell { x, y })
    };
    let start = cell("start x", "start y")?;
    let goal = cell("goal x", "goal y")?;
    let optimal_length = fields.length("optimal length")?;
    fields.end()?;
    Ok(GridTask {
        line,
        bucket,
        map,
        size,
        start,
        goal,
        optimal_length,
    })
}

/// The fields of a line.
struct Fields<'a> {
    line: usize,
    text: &'a str,
    /// The byte at which the next field begins.
    at: usize,
}

impl<'a> Fields<'a> {
    /// The next field and the column it begins in.
    fn next(&mut self) -> Option<(usize, &'a str)> {
        // White space at the end of a line is no field.
        let text = self.text.trim_end();
        let rest = text.get(self.at..)?;
        let tabs = text.contains('\t');
        let rest = if tabs { rest } else { rest.trim_start() };
        if rest.is_empty() {
            return None;
        }
        let begin = text.len() - rest.len();
        let end = if tabs {
            rest.find('\t')
        } else {
            rest.find(char::is_whitespace)
        };
        let field = &rest[..end.unwrap_or(rest.len())];
        self.at = begin + field.len() + usize::from(tabs);
        let column = text[..begin].chars().count() + 1;
        Some((column, field.trim()))
    }

    fn field(&mut self, field: &'static str) -> Result<(usize, &'a str), GridError> {
        let form = FORM;
        self.next()
            .ok_or_else(|| GridError::at(self.line, GridProblem::MissingField { field, form }))
    }

    fn number(&mut self, field: &'static str) -> Result<u32, GridError> {
        let (column, text) = self.field(field)?;
        whole(text).ok_or_else(|| self.bad(column, field, text, NUMBER))
    }

    fn name(&mut self, field: &'static str) -> Result<String, GridError> {
        match self.field(field)? {
            (column, "") => Err(self.bad(column, field, "", "a file name")),
            (_, name) => Ok(name.to_owned()),
        }
    }

    fn length(&mut self, field: &'static str) -> Result<f64, GridError> {
        let (column, text) = self.field(field)?;
        match text.parse::<f64>() {
            Ok(length) if length.is_finite() && length >= 0.0 => Ok(length),
            _ => Err(self.bad(column, field, text, "a number of cells, 0 or more")),
        }
    }

    fn end(&mut self) -> Result<(), GridError> {
        let form = FORM;
        match self.next() {
            None => Ok(()),
            Some((column, found)) => {
                let found = shown(found);
                let problem = GridProblem::ExtraField { found, form };
                Err(GridError::at_column(self.line, column, problem))
            }
        }
    }

    fn bad(
        &self,
        column: usize,
        field: &'static str,
        found: &str,
        expected: &'static str,
    ) -> GridError {
        let found = shown(found);
        let problem = GridProblem::Field {
            field,
            found,
            expected,
        };
        GridError::at_column(self.line, column, problem)
    }
}
