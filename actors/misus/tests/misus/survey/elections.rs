//! When the lander is lost for good, the rover that is elected assigns goals and wishes for new ones.

use super::runs::Run;

/// The lander is lost after an hour; something is wished for afterwards, and something is to be learnt.
const LOST: &str = r#"
until = "0.4sol"
world = { rocks = 20, side = "40m" }
survey.rocks = 2
survey.squares = 0
survey.loop_every = "2h"
goal = [
    { name = "early", observation = "panoramic-image", east_m = 4.0, weight = 50.0 },
    { name = "late", observation = "panoramic-image", north_m = 4.0, weight = 50.0, added = "3h" },
]
"#;

#[test]
fn the_elected_rover_closes_the_loop() {
    let ran = |election: &str, crashes: &[(&str, f64, Option<f64>)]| {
        let text = format!("{LOST}{election}");
        let run = Run {
            text: &text,
            crashes,
            ..Run::default()
        };
        let ran = run.run();
        ran.assert_sound(election);
        ["loops", "wished_editions"].map(|metric| ran.figure(metric))
    };
    let lost = [("lander", 1.0, None)];
    let [loops, editions] = ran("", &lost);
    assert_eq!([loops, editions], [0.0, 1.0]);
    let [loops, editions] = ran("survey.election = \"20min\"", &lost);
    assert!(loops >= 2.0 && editions >= 3.0, "{loops} {editions}");
    // One that comes back follows whoever has been elected meanwhile.
    let back = [("lander", 1.0, Some(2.5))];
    let [loops, editions] = ran("survey.election = \"20min\"", &back);
    assert!(loops >= 2.0 && editions >= 3.0, "{loops} {editions}");
}
