//! What the prioritiser gains over random choice at equal numbers of readings, for each objective: a
//! field in which all rocks were imaged from afar, a few spectra, and then rounds of more spectra,
//! either of the rocks it ranks first or of rocks drawn at random. What is compared is the mean over the
//! rounds, 30 fields in pairs.
//!
//!     cargo run --release -p farside-misus --example prioritiser -- [FIRST_FIELD]

#[path = "support/field.rs"]
#[allow(dead_code, reason = "other examples use the rest")]
mod field;
#[path = "support/rounds.rs"]
mod rounds;

use std::error::Error;

use rounds::{Aim, Choice, Lab, paired};

const FIELDS: u64 = 30;

fn main() -> Result<(), Box<dyn Error>> {
    let first: u64 = std::env::args().nth(1).map_or(Ok(0), |word| word.parse())?;
    for aim in [Aim::Distribution, Aim::Mineral, Aim::Process] {
        let mut lab = Lab::new()?;
        let (mut ranked, mut random) = (Vec::new(), Vec::new());
        for seed in first..first + FIELDS {
            let field = field::field(seed, 90);
            ranked.push(lab.mean(&field, aim, Choice::Ranked)?);
            random.push(lab.mean(&field, aim, Choice::Random)?);
        }
        let (difference, t) = paired(&ranked, &random);
        let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
        println!(
            "{aim:?}: ranked {:.3}, random {:.3}, difference {difference:+.3}, t {t:.2}",
            mean(&ranked),
            mean(&random),
        );
    }
    Ok(())
}
