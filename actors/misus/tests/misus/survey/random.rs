//! Random small surveys with trouble of all kinds: no plan violates anything, and no goal is lost.

use proptest::prelude::*;

use super::runs::Run;

const FAULTS: [&str; 4] = [
    "",
    "[[rover.fault]]\nat = '30min'\nkind = 'blocked-path'\n",
    "[[rover.fault]]\nat = '1h'\nkind = 'never-ends'\npart = 'wheels'\nduration = '1h'\n",
    "[[rover.fault]]\nat = '20min'\nkind = 'instrument-fails'\npart = 'mini_tes'\nduration = '2h'\n",
];

const HOSTS: [&str; 4] = ["rover_01", "rover_02", "lander", "rover_02"];

const SURVEYS: [&str; 4] = [
    "survey.protocol = 'lease'\n",
    "survey.protocol = 'assign-and-release'\n",
    "survey.lease = '3h'\nsurvey.reassign = 'lease'\n",
    "survey.election = '20min'\nexecution.mode = 'batch'\n",
];

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, max_shrink_iters: 20, ..ProptestConfig::default() })]

    #[test]
    fn no_survey_violates_a_plan_or_loses_a_goal(
        seed in 1..1000u64,
        (fault, survey, host) in (0..4usize, 0..4usize, 0..4usize),
        (loss, contact) in (0.0..0.8f64, prop::sample::select(vec![1.0, 0.4])),
        (crash_h, for_h) in (0.1..5.0f64, prop::option::of(0.1..2.0f64)),
        joint in 1..=2u32,
    ) {
        let text = format!(
            "until = '6h'\nworld = {{ rocks = 12, side = '30m' }}\nteam.rovers = 2\n\
             links.default.loss = {loss}\nsurvey.contact = {contact}\nsurvey.rocks = 4\nsurvey.squares = 0\n{}\
             [[goal]]\nname = 'own'\nobservation = 'panoramic-image'\neast_m = 5.0\nrovers = {joint}\n{}",
            SURVEYS[survey], FAULTS[fault],
        );
        let crashes = [(HOSTS[host], crash_h, for_h.map(|for_h| crash_h + for_h))];
        let run = Run { text: &text, seed, crashes: &crashes, ..Run::default() };
        let ran = run.run();
        ran.assert_sound(&text);
    }
}
