//! Learns the classes of 30 surveyed fields, and writes features, truth, classes and parameters as
//! JSON, a field on each line, for programs that learn the same: `experiments/oracles/mixture.py`
//! reads it. To stderr goes what came of it.
//!
//! It demonstrates in particular how features, rocks and mixtures are used without a simulation.
//!
//!     cargo run --release -p farside-misus --example mixture_fields -- [FIRST_FIELD [ROCKS]]

#[path = "support/field.rs"]
mod field;

use std::error::Error;

use farside_misus::analysis::learned::Learned;
use farside_misus::analysis::library::ReferenceLibrary;
use farside_misus::analysis::mixture::{FitSettings, Mixture, Table, fit};
use farside_misus::analysis::scores::{adjusted_rand_index, distribution_error};
use farside_worlds::spectra::wavelength_grid_nm;
use serde_json::{Value, json};

const FIELDS: u64 = 30;

/// The same values without what is known of their noise, which other programs do not model.
fn without_noise(table: &Table) -> Table {
    let mut plain = Table::new(table.columns(), table.columns() - table.position_at());
    for row in 0..table.len() {
        plain.push(table.row(row), &vec![0.0; table.columns()]);
    }
    plain
}

fn parameters(mixture: &Mixture) -> Value {
    let classes = 0..mixture.classes();
    json!({
        "weights": mixture.weights(),
        "means": classes.clone().map(|k| mixture.mean(k)).collect::<Vec<_>>(),
        "variances": classes.map(|k| mixture.variance(k)).collect::<Vec<_>>(),
    })
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let first: u64 = arguments.next().map_or(Ok(0), |word| word.parse())?;
    let rocks: usize = arguments.next().map_or(Ok(90), |word| word.parse())?;
    let basis = ReferenceLibrary::mixed(&wavelength_grid_nm(), 300).basis()?;
    let (mut indices, mut errors) = (Vec::new(), Vec::new());
    for seed in first..first + FIELDS {
        let field = field::field(seed, rocks);
        let truth = field::truth(&field);
        let rows = field::survey(&field, &basis, field::NOISE);
        let learned = Learned::from_rows(&rows, &FitSettings::default())?;
        let classes = learned.hard_classes();
        let index = adjusted_rand_index(&classes, &truth);
        let shares = learned.fit.mixture.weights();
        let error = distribution_error(shares, &classes, &truth);

        let plain = without_noise(learned.rocks.table());
        let settings = FitSettings {
            position_weight: 1.0,
            ..FitSettings::default()
        };
        let mixture = fit(&plain, &settings)?.mixture;
        let line = json!({
            "field": seed,
            "story": field.story().name(),
            "stretched": seed % 5 == 0,
            "truth": truth,
            "features": (0..plain.len()).map(|row| plain.row(row)).collect::<Vec<_>>(),
            "classes": classes,
            "k": learned.classes(),
            "ari": index,
            "plain": parameters(&mixture),
            "plain_log_likelihood": mixture.log_likelihood(&plain)?,
        });
        println!("{line}");
        eprintln!(
            "field {seed:3} {:8} {} classes, ARI {index:.3}, error of shares {error:.3}",
            field.story().name(),
            learned.classes(),
        );
        indices.push(index);
        errors.push(error);
    }
    indices.sort_by(f64::total_cmp);
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    eprintln!(
        "mean ARI {:.3}, worst decile up to {:.3}, mean error of shares {:.3}",
        mean(&indices),
        indices[indices.len() / 10 - 1],
        mean(&errors),
    );
    Ok(())
}
