//! Explanations on the models that come with the crate.

use std::sync::Arc;

use super::*;
use crate::language::{Options, read_model, read_problem};
use crate::sch;

const REQUEST: Request = Request {
    operations: 2_000_000,
    seed: 1,
    is_proven: false,
};

pub(super) fn read(model: &str, problem: &str) -> (Arc<Model>, Arc<Problem>) {
    let model = read_model("m.ddl", model, &Options::default()).ok();
    let model = model.unwrap_or_else(|findings| panic!("{findings}"));
    let problem = read_problem("p.ddl", problem, &model, &Options::default()).ok();
    let problem = problem.unwrap_or_else(|findings| panic!("{findings}"));
    (Arc::new(model), Arc::new(problem))
}

#[test]
fn scratch_rover() {
    let (model, problem) = read(
        include_str!("../../models/rover.ddl"),
        include_str!("../../models/rover-too-much.ddl"),
    );
    let told = missing_plan(&model, &problem, REQUEST);
    println!("{told}");
    println!("{}", serde_json::to_string_pretty(&told).unwrap());
}

#[test]
fn scratch_rcpsp_explained() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/models/rcpsp_max/");
    let ans = std::fs::read_to_string(format!("{folder}answers.csv")).unwrap();
    for row in ans.lines().skip(1) {
        let cells: Vec<&str> = row.split(',').collect();
        let bytes = std::fs::read(format!("{folder}{}", cells[0])).unwrap();
        let (m, p) = sch::read(cells[0], &bytes).unwrap();
        let (m, p) = (Arc::new(m), Arc::new(p));
        use crate::search::{Both, Forward, Planner, Settings};
        let settings = Settings {
            operations: 100_000 * p.goals.len() as u64,
            seed: 1,
        };
        let a = Forward.solve(&m, &p, settings).unwrap();
        let b = Both::default().solve(&m, &p, settings).unwrap();
        println!(
            "{} {} {} -> forward {:?} proven {} ops {} backtracks {}; both {:?} {}",
            cells[0],
            cells[2],
            cells[3],
            a.plan.map(|p| p.makespan),
            a.proven,
            a.operations,
            a.counters.backtracks,
            b.plan.map(|p| p.makespan),
            b.proven
        );
        if cells[2] == "1" {
            continue;
        }
        let told = missing_plan(&m, &p, REQUEST);
        println!("== {}\n{told}", cells[0]);
        println!("{:?} {}", told.smallest, told.operations);
    }
}
