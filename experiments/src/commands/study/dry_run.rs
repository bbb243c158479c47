//! `farside study --dry-run`: what a study would do, before it does.

use indicatif::HumanDuration;

use crate::commands::{CommandError, Exit, print, print_json};
use crate::study::{Basis, Forecast, Interrupts, RunOptions, StudyPlan, forecast};

/// Prints how many runs there are to do and about how long they take.
pub(super) fn tell(
    plan: &StudyPlan,
    options: &RunOptions,
    interrupts: &Interrupts,
    as_json: bool,
) -> Result<Exit, CommandError> {
    let told = forecast(plan, options, interrupts)?;
    if interrupts.is_raised() {
        return Ok(Exit::Failed);
    }
    if as_json {
        let mut document = serde_json::to_value(&told)?;
        document["wall_s"] = told.wall_s(told.runs).into();
        document["wall_s_at_most"] = told.wall_s(told.runs_at_most).into();
        print_json(&document)?;
    } else {
        print(text(&plan.manifest.study, &told, options))?;
    }
    Ok(Exit::Done)
}

fn text(study: &str, told: &Forecast, options: &RunOptions) -> String {
    let Forecast {
        cells,
        seeds,
        runs,
        runs_at_most,
        done,
        jobs,
        ..
    } = told;
    let folder = options.folder.display();
    let up_to = if runs == runs_at_most { "" } else { "up to " };
    let mut text = format!("{study}: {cells} cells, {up_to}{seeds} seeds each");
    if *done > 0 {
        text += &format!("; {done} runs are done, in {folder}");
    }
    let range = |least: String, most: String| match least == most {
        true => least,
        false => format!("{least} to {most}"),
    };
    let left = range(runs.to_string(), runs_at_most.to_string());
    text += &format!("\n{left} runs to do");
    let whole = |s: f64| HumanDuration(std::time::Duration::from_secs_f64(s)).to_string();
    if let (Some(least), Some(most)) = (told.wall_s(*runs), told.wall_s(*runs_at_most))
        && *runs_at_most > 0
    {
        let about = range(whole(least), whole(most));
        let jobs = match jobs {
            1 => "one at a time".to_owned(),
            jobs => format!("{jobs} at once"),
        };
        text += &format!(", {jobs}: about {about}");
    }
    let run_s = told.run_s.unwrap_or(0.0);
    text += &match told.basis {
        Some(Basis::Stored { runs }) => format!(
            "\n  by the mean of {runs} runs whose times are in {folder}: {run_s:.2} s a run\n"
        ),
        Some(Basis::Tried { runs }) => format!(
            "\n  by the mean of {runs} runs tried now, the first seed of the first, the middle and \
             the last cell: {run_s:.2} s a run; others may take longer\n"
        ),
        None => "\n  how long they take is not known: no run could be tried\n".to_owned(),
    };
    text
}
