//! The same problem gives the same plan, whoever runs it and how often.

use super::*;
use crate::plan::Plan;

/// 64 bits of FNV-1a of what a plan says of its tokens: the same on any machine.
fn hash(plan: &Plan) -> u64 {
    let mut hash = 0xcbf2_9ce4_8422_2325;
    for token in &plan.tokens {
        for byte in format!("{token}\n").bytes() {
            hash = (hash ^ u64::from(byte)).wrapping_mul(0x100_0000_01b3);
        }
    }
    hash
}

fn psp2() -> (Arc<Model>, Arc<Problem>) {
    let read = crate::sch::read("psp2.sch", include_bytes!("../../../models/psp2.sch"));
    let (model, problem) = read.expect("it is right");
    (Arc::new(model), Arc::new(problem))
}

/// aries #211: an optimum does not depend on the run.
#[test]
fn the_same_seed_gives_the_same_plan() {
    let settings = Settings {
        operations: 2_000_000,
        seed: 7,
    };
    let planners: [&dyn Planner; 2] = [&Forward, &Repair::default()];
    let mut found = Vec::new();
    for (model, problem) in [rover(), psp2()] {
        for planner in planners {
            let [one, other] = [(); 2].map(|()| {
                let answer = planner.solve(&model, &problem, settings).expect("it loads");
                answer.plan.expect("there is a plan")
            });
            assert_eq!(hash(&one), hash(&other), "{}", planner.name());
            found.push(format!("{} {:016x}", planner.name(), hash(&one)));
        }
    }
    assert_eq!(found, GOLDEN);
}

/// By problem and planner. They change where a search does: then, and only then, they are renewed.
const GOLDEN: [&str; 4] = [
    "forward d1de97b47651d996",
    "repair d11ac64004f863ab",
    "forward d7fa8c95889081ea",
    "repair 819e3667bf2e50ea",
];

/// PlanSys2 #261: what a goal says in numbers holds in the plan.
#[test]
fn numbers_of_goals_are_not_dropped() {
    let (model, problem) = rover();
    let settings = Settings {
        operations: 2_000_000,
        seed: 1,
    };
    let planners: [&dyn Planner; 2] = [&Forward, &Repair::default()];
    for planner in planners {
        let answer = planner.solve(&model, &problem, settings).expect("it loads");
        let plan = answer.plan.expect("there is a plan");
        let downlink = plan.tokens.iter().find(|at| at.predicate == "Downlink");
        let downlink = downlink.expect("the downlink is mandatory");
        assert!(downlink.to_string().contains("10"), "{downlink}");
        assert!((300..=400).contains(&downlink.start), "{downlink}");
        assert_eq!(checker::check(&model, &problem, &plan), []);
    }
}
