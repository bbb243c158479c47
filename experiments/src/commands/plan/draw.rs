//! `farside plan draw`: a plan as a Gantt chart.

use std::path::PathBuf;

use farside_planning::draw;

use super::files::{self, PlanError};
use crate::commands::output::{self, Format};
use crate::commands::{CommandError, Exit, print};

#[derive(clap::Args)]
pub(super) struct Args {
    /// The plan
    #[arg(value_name = "PLAN.json")]
    plan: PathBuf,
    /// Where to write the chart, as SVG
    #[arg(long, value_name = "PLAN.svg")]
    out: PathBuf,
}

pub(super) fn run(args: &Args) -> Result<Exit, CommandError> {
    let plan = files::read_plan(&args.plan)?;
    let svg = draw::svg(&plan).map_err(|source| PlanError::Draw {
        path: args.plan.clone(),
        source,
    })?;
    let inputs = std::slice::from_ref(&args.plan);
    output::spare(inputs, std::slice::from_ref(&args.out))?;
    output::write_whole(&args.out, svg.as_bytes(), Format::Svg, inputs)?;
    print(format!(
        "{}: {} tokens of {}",
        args.out.display(),
        plan.tokens.len(),
        plan.problem
    ))?;
    Ok(Exit::Done)
}
