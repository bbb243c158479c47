//! Rovers that learn alone and exchange their rows over links that lose a third of all messages.

use farside::random::RandomKey;
use farside_misus::analysis::exchange::Exchange;
use farside_misus::analysis::learned::Learned;
use farside_misus::analysis::library::ReferenceLibrary;
use farside_misus::analysis::mixture::FitSettings;
use farside_misus::analysis::reading::Origin;
use farside_misus::analysis::scores::adjusted_rand_index;
use farside_worlds::RockField;
use farside_worlds::spectra::wavelength_grid_nm;

use super::field;

const ROVERS: usize = 3;
const ROUNDS: usize = 30;

/// Everyone offers to everyone.
fn round(rovers: &mut [Exchange], lost: &mut dyn FnMut() -> bool) {
    for from in 0..rovers.len() {
        for to in (0..rovers.len()).filter(|&to| to != from) {
            if let Some(message) = rovers[from].offer(to as u32)
                && !lost()
            {
                rovers[to].receive(&message).unwrap();
            }
        }
    }
}

/// Each rover reads a rock in each round; every fifth is one that another has read.
fn explore(field: &RockField, loss: f64, round_without_loss: bool) -> Vec<Learned> {
    let basis = ReferenceLibrary::mixed(&wavelength_grid_nm(), 300)
        .basis()
        .unwrap();
    let key = RandomKey::new(field.settings().seed);
    let mut noise = key.text("noise").stream();
    let mut losses = key.text("loss").stream();
    let mut rovers: Vec<Exchange> = (0..ROVERS as u32)
        .map(|rover| {
            Exchange::new(Origin {
                rover,
                incarnation: 0,
            })
        })
        .collect();
    for turn in 0..ROUNDS {
        for (rover, exchange) in rovers.iter_mut().enumerate() {
            let own = turn * ROVERS + rover;
            let rock = if turn % 5 == 4 { own - ROVERS + 1 } else { own };
            let spectral = field::spectral(field, &basis, rock, field::NOISE, &mut noise);
            let textural = field::textural(field, rock, field::NOISE, &mut noise);
            let row = field::row(field, 0, rock, Some(spectral), Some(textural));
            exchange.record(row.reading).unwrap();
        }
        round(&mut rovers, &mut || losses.chance(loss));
    }
    if round_without_loss {
        round(&mut rovers, &mut || false);
    }
    rovers
        .iter()
        .map(|rover| Learned::from_rows(rover.rows(), &FitSettings::default()).unwrap())
        .collect()
}

fn index(field: &RockField, learned: &Learned) -> f64 {
    let truth = field::truth(field);
    let of_read: Vec<usize> = (learned.rocks.numbers().iter())
        .map(|&rock| truth[rock as usize])
        .collect();
    adjusted_rand_index(&learned.hard_classes(), &of_read)
}

#[test]
fn loss_hardly_matters_and_models_agree_after_a_round_without() {
    let seeds = [4, 6, 7];
    let (mut with_loss, mut without) = (0.0, 0.0);
    for seed in seeds {
        let field = field::field(seed, 90);
        let lossless = &explore(&field, 0.0, false)[0];
        without += index(&field, lossless);
        let rovers = explore(&field, 0.3, false);
        with_loss += rovers.iter().map(|l| index(&field, l)).sum::<f64>() / ROVERS as f64;
        for learned in explore(&field, 0.3, true) {
            // Bit for bit, and so to 1e-6.
            assert_eq!(&learned, lossless);
        }
    }
    let difference = (with_loss - without) / seeds.len() as f64;
    assert!(difference.abs() <= 0.02, "{difference}");
}
