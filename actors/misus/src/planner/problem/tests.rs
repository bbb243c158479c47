//! What is generated, what is read, and what is refused.

use super::*;

fn drawn() -> Problem {
    generate(&ProblemConfig::default(), 3).unwrap()
}

fn refused(change: impl FnOnce(&mut Problem)) -> String {
    let mut problem = drawn();
    change(&mut problem);
    problem.resolve().unwrap_err().to_string()
}

#[test]
fn problems_are_what_the_tables_say() {
    let mut combinations = 0;
    let mut rocks = Vec::new();
    for seed in 0..100 {
        let problem = generate(&ProblemConfig::default(), seed).unwrap();
        assert!((40.0..100.0).contains(&problem.side_m));
        assert!((10..=30).contains(&(problem.goals.len() / 3)));
        rocks.push(problem.goals.len() / 3);
        combinations += problem.combinations.len();
        for rock in problem.goals.chunks(3) {
            let value = rock[0].weight - 11.0;
            assert!((1.0..=14.0).contains(&value));
            assert_eq!((rock[1].weight, rock[2].weight), (value + 6.0, value + 1.0));
            assert_eq!(rock[1].position_m, rock[2].position_m);
            let [east_m, north_m] =
                [0, 1].map(|at| rock[0].position_m[at] - rock[1].position_m[at]);
            assert!((libm::hypot(east_m, north_m) - 8.0).abs() < 1e-9);
        }
    }
    // Half of three for each rock, of some 2000 rocks: within 3 %.
    let expected = rocks.iter().sum::<usize>() as f64 * 1.5;
    assert!((combinations as f64 / expected - 1.0).abs() < 0.03);
    assert_eq!(
        (rocks.iter().min(), rocks.iter().max()),
        (Some(&10), Some(&30))
    );
}

#[test]
fn what_is_written_is_read_again_to_the_last_bit() {
    let config = ProblemConfig {
        joint_share: 0.3,
        ..ProblemConfig::default()
    };
    let problem = generate(&config, 8).unwrap();
    assert!(problem.goals.iter().any(|goal| goal.rovers == 2));
    assert_eq!(Problem::from_json(&problem.to_json()).unwrap(), problem);
}

#[test]
fn other_formats_and_broken_texts_are_refused_with_their_place() {
    let text = drawn().to_json();
    let newer = Problem::from_json(&text.replace("\"1.0\"", "\"2.3\"")).unwrap_err();
    assert_eq!(
        newer.to_string(),
        "format \"2.3\": this program reads \"1.0\""
    );
    Problem::from_json(&text.replace("\"1.0\"", "\"1.7\"")).unwrap();
    let unknown = Problem::from_json(&text.replacen("\"side_m\"", "\"side\"", 1)).unwrap_err();
    let unknown = unknown.to_string();
    assert!(
        unknown.starts_with("line 4, column 8: unknown field `side`"),
        "{unknown}"
    );
    let cut = Problem::from_json(&text[..300]).unwrap_err().to_string();
    assert!(cut.starts_with("line ") && cut.contains("EOF"), "{cut}");
}

#[test]
fn what_cannot_be_is_refused_by_name() {
    for (change, expected) in [
        (
            (|p: &mut Problem| p.goals[4].position_m[1] = 80.0) as fn(&mut Problem),
            "goal \"rock_02_b\": at (",
        ),
        (
            |p| p.goals[4].position_m[0] = f64::NAN,
            "goal \"rock_02_b\": at (NaN m,",
        ),
        (
            |p| p.combinations[0].goals[1] = "rock_1_b".to_owned(),
            "unknown goal \"rock_1_b\"; did you mean \"rock_01_b\"?",
        ),
        (
            |p| p.combinations[0].goals.truncate(1),
            "goals is 1, expected 2 to 1000",
        ),
        (
            |p| p.goals[0].weight = f64::NAN,
            "goal \"rock_01_a\": weight is NaN, expected a number from -1e9 to 1e9",
        ),
        (
            |p| p.combinations[0].weight = f64::INFINITY,
            "weight is inf, expected a number from -1e9 to 1e9",
        ),
        (
            |p| p.goals[1].name = "rock_01_a".to_owned(),
            "goal \"rock_01_a\": expected a name that no other goal has",
        ),
        (
            |p| p.goals[0].window_ms = Some([5_000, 5_100]),
            "goal \"rock_01_a\": window_ms is 5000 to 5100",
        ),
        (
            |p| p.activities[0].window_ms = [i64::MAX, i64::MAX],
            "activity \"rover_01_communication_1\": window_ms is",
        ),
        (
            |p| p.activities[0].rover = "rover_9".to_owned(),
            "unknown rover \"rover_9\"",
        ),
        (
            |p| p.rovers[1].sols[1].opens_ms = 3,
            "rover \"rover_02\": opens_ms is 3, expected 18000000 to",
        ),
        (
            |p| p.rovers[0].memory_bits = -1,
            "rover \"rover_01\": memory_bits is -1",
        ),
        (|p| p.rovers.clear(), "rovers is 0, expected 1 to 1000"),
        (|p| p.side_m = f64::NAN, "side_m is NaN"),
    ] {
        let found = refused(change);
        assert!(found.contains(expected), "{found}\nis not\n{expected}");
    }
}

#[test]
fn a_circle_of_requirements_is_named() {
    let found = refused(|problem| {
        for (goal, requires) in [(0, 1), (1, 2), (2, 1)] {
            let name = problem.goals[requires].name.clone();
            problem.goals[goal].requires.push(name);
        }
    });
    let expected = "goals that require each other in a circle: rock_01_b, rock_01_c";
    assert_eq!(found, expected);
}

#[test]
fn settings_out_of_range_are_refused() {
    let config = ProblemConfig {
        stand_off_m: 11.0,
        ..ProblemConfig::default()
    };
    let found = generate(&config, 1).unwrap_err().to_string();
    assert!(
        found.contains("problem.stand_off: 11 m: expected 0 to 10 m"),
        "{found}"
    );
}
