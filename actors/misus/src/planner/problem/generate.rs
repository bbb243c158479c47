//! The paper's generator of problems (section 5.1).

use farside::SimDuration;
use farside::random::{RandomKey, Stream};
use farside_actors::system::settings::Table;

use crate::planner::objective::ObjectiveConfig;

use super::{
    Activity, Combination, FORMAT, Goal, Kind, Problem, ProblemConfig, ProblemError, Rover, Sol,
};

/// From the start of one sol to that of the next \[ms\]: a mean solar day of Mars.
const SOL_MS: i64 = 88_775_244;

/// Draws the problem of a seed: the same on any machine. What is drawn for one rock or rover hangs on
/// the seed and its number alone, so that problems of more rocks differ in the others only.
///
/// # Errors
/// When a value of the settings is out of its range, or no problem can have it.
pub fn generate(config: &ProblemConfig, seed: u64) -> Result<Problem, ProblemError> {
    config
        .check("problem")
        .map_err(|error| ProblemError::Value {
            what: "the generator".to_owned(),
            key: "a setting",
            found: error.to_string(),
            expected: "what its documentation says".to_owned(),
        })?;
    let key = RandomKey::new(seed).text("problem");
    let mut stream = key.text("size").stream();
    let side_m = stream.uniform_in(
        config.side_least_m,
        config.side_most_m.max(config.side_least_m),
    );
    let more = config.rocks_most.saturating_sub(config.rocks_least);
    let rocks = config.rocks_least + stream.below(u64::from(more) + 1) as u32;
    let mut problem = Problem {
        format: FORMAT.to_owned(),
        name: format!("seed {seed}, {rocks} rocks"),
        side_m,
        rovers: Vec::new(),
        goals: Vec::new(),
        combinations: Vec::new(),
        activities: Vec::new(),
        objective: ObjectiveConfig::default(),
    };
    for number in 0..config.rovers {
        let stream = key.text("rover").number(u64::from(number)).stream();
        add_rover(&mut problem, config, number, stream);
    }
    for number in 0..rocks {
        let stream = key.text("rock").number(u64::from(number)).stream();
        add_rock(&mut problem, config, number, stream);
    }
    problem.resolve()?;
    Ok(problem)
}

fn add_rover(problem: &mut Problem, config: &ProblemConfig, number: u32, mut stream: Stream) {
    let name = format!("rover_{:02}", number + 1);
    let length_ms = ms(config.sol_length);
    let start = 0..i64::from(config.sols);
    let sols: Vec<Sol> = start
        .map(|sol| Sol {
            opens_ms: sol * SOL_MS.max(length_ms),
            closes_ms: sol * SOL_MS.max(length_ms) + length_ms,
            energy_uj: whole(config.energy_j * 1e6),
        })
        .collect();
    for (number, sol) in sols.iter().enumerate() {
        let window_ms = ms(config.communication_window).min(length_ms);
        problem.activities.push(Activity {
            name: format!("{name}_communication_{}", number + 1),
            rover: name.clone(),
            sol: number,
            window_ms: [sol.closes_ms - window_ms, sol.closes_ms],
            duration_ms: ms(config.communication),
            power_mw: whole(config.communication_power_w * 1e3),
            sends_bits: config.communication_bits as i64,
        });
    }
    let turn = stream.uniform() * std::f64::consts::TAU;
    // The root makes places even over the disc.
    let away_m = config.start_within_m * libm::sqrt(stream.uniform());
    problem.rovers.push(Rover {
        name,
        position_m: [away_m * libm::cos(turn), away_m * libm::sin(turn)],
        speed_mm_s: whole(config.speed_m_per_s * 1e3) as u32,
        drive_mw: whole(config.drive_power_w * 1e3),
        memory_bits: config.memory_bits as i64,
        stored_bits: 0,
        sols,
    });
}

fn add_rock(problem: &mut Problem, config: &ProblemConfig, number: u32, mut stream: Stream) {
    let half_m = problem.side_m / 2.0;
    let rock_m = [(); 2].map(|()| stream.uniform_in(-half_m, half_m));
    let value = 1.0 + stream.below(u64::from(config.value_most)) as f64;
    let from_afar_m = loop {
        let turn = stream.uniform() * std::f64::consts::TAU;
        let east_m = rock_m[0] + config.stand_off_m * libm::cos(turn);
        let north_m = rock_m[1] + config.stand_off_m * libm::sin(turn);
        if east_m.abs() <= half_m && north_m.abs() <= half_m {
            break [east_m, north_m];
        }
    };
    let joint = stream.chance(config.joint_share);
    let name = |letter: char| format!("rock_{:02}_{letter}", number + 1);
    let goal = |letter, kind, position_m, reward: f64| Goal {
        name: name(letter),
        rock: Some(number),
        kind: Some(kind),
        position_m,
        duration_ms: ms(config.duration(kind)),
        power_mw: whole(config.power_w(kind) * 1e3),
        memory_bits: config.bits(kind) as i64,
        weight: value + reward,
        window_ms: None,
        requires: Vec::new(),
        rovers: 1,
        mandatory: false,
    };
    let a = goal('a', Kind::LongRangeImage, from_afar_m, config.reward_a);
    let mut b = goal('b', Kind::CloseUpImage, rock_m, config.reward_b);
    let c = goal('c', Kind::CloseUpSpectrum, rock_m, config.reward_c);
    if joint {
        (b.rovers, b.weight) = (2, b.weight * config.joint_factor);
    }
    let factor_ac = match stream.chance(config.factor_ac_share) {
        true => config.factor_ac,
        false => config.factor_ac_else,
    };
    for (first, second, factor) in [
        (&a, &b, config.factor_ab),
        (&a, &c, factor_ac),
        (&b, &c, config.factor_bc),
    ] {
        if !stream.chance(config.combination_dropped) {
            problem.combinations.push(Combination {
                goals: vec![first.name.clone(), second.name.clone()],
                weight: (first.weight + second.weight) * factor,
            });
        }
    }
    problem.goals.extend([a, b, c]);
}

impl ProblemConfig {
    fn duration(&self, kind: Kind) -> SimDuration {
        match kind {
            Kind::LongRangeImage => self.duration_a,
            Kind::CloseUpImage => self.duration_b,
            Kind::CloseUpSpectrum => self.duration_c,
        }
    }

    fn power_w(&self, kind: Kind) -> f64 {
        match kind {
            Kind::LongRangeImage => self.power_a_w,
            Kind::CloseUpImage => self.power_b_w,
            Kind::CloseUpSpectrum => self.power_c_w,
        }
    }

    fn bits(&self, kind: Kind) -> u64 {
        match kind {
            Kind::LongRangeImage => self.memory_a_bits,
            Kind::CloseUpImage => self.memory_b_bits,
            Kind::CloseUpSpectrum => self.memory_c_bits,
        }
    }
}

fn ms(duration: SimDuration) -> i64 {
    (duration.as_nanos() / 1_000_000) as i64
}

/// The nearest whole number: settings are in their ranges, where there is one.
fn whole(value: f64) -> i64 {
    libm::round(value) as i64
}
