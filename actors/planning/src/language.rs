//! The language of models and problems: from text to tables, with what is wrong and where.
//!
//! It is the syntax of DDL, the Domain Description Language of the HSTS, Remote Agent and EUROPA
//! planners (section 3.3 of the IDEA paper, Figure 5), extended by resources, decompositions,
//! goals with weights and rules for the search. `docs/src/reference/planning.md` is its reference.
//!
//! A reading goes on after a mistake, and reports up to [`MOST_FINDINGS`] of them.

mod analyse;
mod findings;
mod format;
mod functions;
mod include;
mod lexer;
mod parser;
#[cfg(test)]
mod tests;
mod tree;

pub use findings::{Finding, Findings, MOST_FINDINGS, Severity};
pub use functions::{Call, Functions};
pub use include::{Disk, Include};

use crate::model::{Model, Problem};
use findings::Notes;

/// How a text is read.
#[derive(Clone, Default)]
pub struct Options<'a> {
    /// Refuses what the syntax allows only for the sake of texts printed in papers.
    pub strict: bool,
    /// The functions that a model may call.
    pub functions: Functions,
    /// Where included files come from; without it, a text that includes any is refused.
    pub include: Option<&'a dyn Include>,
}

/// What came of a reading.
#[derive(Clone, Debug)]
pub struct Read<T> {
    /// What the text says; none if there is an error among the findings.
    pub value: Option<T>,
    /// What is wrong or odd, in the order of the text; at most [`MOST_FINDINGS`].
    pub findings: Vec<Finding>,
    /// How many findings more there were.
    pub omitted: usize,
}

impl<T> Read<T> {
    /// What the text says, without its warnings.
    ///
    /// # Errors
    ///
    /// All findings, if one of them is an error.
    pub fn ok(self) -> Result<T, Findings> {
        self.value.ok_or(Findings(self.findings))
    }

    fn of(value: Option<T>, notes: Notes) -> Read<T> {
        let value = value.filter(|_| !notes.has_errors());
        let (findings, omitted) = notes.finish();
        Read {
            value,
            findings,
            omitted,
        }
    }
}

/// Reads a model. `name` is the name of its file, which findings give and relative to which it
/// includes others.
///
/// ```
/// use farside_planning::language::{Options, read_model};
/// let text = "
/// (Define_Object_Class Rover :state_variables ((State Camera_SV)))
/// (Define_Predicate Idle ())
/// (Define_Predicate TakeImage ((Number ?exposure)))
/// (Define_Member_Values (Rover Camera_SV) (Idle TakeImage) :default (Idle ()))
/// (Define_Compatibility
///  (SINGLE ((Rover Camera_SV) ((TakeImge (?exposure)))))
///  :duration_bounds [?exposure ?exposure])
/// ";
/// let read = read_model("camera.ddl", text, &Options::default());
/// assert_eq!(
///     read.findings[0].to_string(),
///     "camera.ddl:7:31: error: expected a predicate of Camera_SV, found TakeImge; \
///      the nearest is TakeImage"
/// );
/// let right = text.replace("TakeImge", "TakeImage");
/// let model = read_model("camera.ddl", &right, &Options::default()).ok()?;
/// assert_eq!(model.timelines[0].name, "Camera_SV");
/// assert_eq!(model.rules.len(), 1);
/// # Ok::<(), farside_planning::language::Findings>(())
/// ```
pub fn read_model(name: &str, text: &str, options: &Options) -> Read<Model> {
    let mut notes = Notes::default();
    let loaded = include::load(name, text, options.strict, options.include, &mut notes);
    let model = analyse::model(&loaded, &options.functions, &mut notes);
    Read::of(Some(model), notes)
}

/// Reads a problem of a model. `name` is the name of its file.
///
/// ```
/// use farside_planning::language::{Options, read_model, read_problem};
/// let model = "
/// (Define_Object_Class Rover :state_variables ((State Camera_SV)))
/// (Define_Predicate TakeImage ((Number ?exposure)))
/// (Define_Member_Values (Rover Camera_SV) (TakeImage))
/// ";
/// let model = read_model("camera.ddl", model, &Options::default()).ok()?;
/// let problem = "
/// (Define_Problem noon :horizon [0 100])
/// (Goal image (SINGLE ((Rover Camera_SV) ((TakeImage (5))))) :start [40 60] :weight 2.5)
/// ";
/// let problem = read_problem("noon.ddl", problem, &model, &Options::default()).ok()?;
/// assert_eq!((problem.horizon, problem.goals[0].weight), (100, Some(2.5)));
/// # Ok::<(), farside_planning::language::Findings>(())
/// ```
pub fn read_problem(name: &str, text: &str, model: &Model, options: &Options) -> Read<Problem> {
    let mut notes = Notes::default();
    let loaded = include::load(name, text, options.strict, options.include, &mut notes);
    let problem = analyse::problem(&loaded, model, &mut notes);
    Read::of(Some(problem), notes)
}

/// A text in its normal form, which says the same: comments are kept, and the normal form of a
/// normal form is the same bytes.
///
/// # Errors
///
/// If its lists are not well formed. Names are not looked at.
///
/// ```
/// use farside_planning::language::format;
/// let text = "(Define_Type Side(left,right)) ; of the mast";
/// assert_eq!(format(text)?, "(Define_Type Side (left right)) ; of the mast\n");
/// # Ok::<(), farside_planning::language::Findings>(())
/// ```
pub fn format(text: &str) -> Result<String, Findings> {
    format::format(text)
}
