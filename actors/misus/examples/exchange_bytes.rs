//! How many bytes rovers exchange to hold the same model: rows that are sent until acknowledged,
//! beside the sums that distributed expectation maximisation would send.
//!
//! Three rovers read a rock each in each of 30 rounds and offer their rows to each other. Sums are
//! counted as favourably as can be: each rover sends, to each other and for each step, the shares,
//! sums and sums of squares of each class as 4-byte numbers, without loss, once at the end; 1 to 7
//! classes are tried from one start of 20 steps each.
//!
//!     cargo run --release -p farside-misus --example exchange_bytes

#[path = "support/field.rs"]
#[allow(dead_code, reason = "other examples use the rest")]
mod field;

use std::error::Error;

use farside::encoding::Schema;
use farside::random::RandomKey;
use farside_misus::analysis::exchange::{Exchange, Statistics};
use farside_misus::analysis::library::ReferenceLibrary;
use farside_misus::analysis::reading::Origin;
use farside_misus::analysis::rocks::COLUMNS;
use farside_worlds::spectra::wavelength_grid_nm;

const ROVERS: usize = 3;
const ROUNDS: usize = 30;

fn main() -> Result<(), Box<dyn Error>> {
    let basis = ReferenceLibrary::mixed(&wavelength_grid_nm(), 300).basis()?;
    let field = field::field(4, ROVERS * ROUNDS);
    let rows = field::survey(&field, &basis, field::NOISE);
    let schema = Schema::of::<Statistics>()?;
    for loss in [0.0, 0.3, 0.6] {
        let mut losses = RandomKey::new(1).text("loss").stream();
        let mut rovers: Vec<Exchange> = (0..ROVERS as u32)
            .map(|rover| {
                let incarnation = 0;
                Exchange::new(Origin { rover, incarnation })
            })
            .collect();
        let mut bytes = Vec::new();
        let mut messages = 0;
        for turn in 0..ROUNDS {
            for (rover, exchange) in rovers.iter_mut().enumerate() {
                exchange.record(rows[turn * ROVERS + rover].reading)?;
            }
            for from in 0..ROVERS {
                for to in (0..ROVERS).filter(|&to| to != from) {
                    let Some(message) = rovers[from].offer(to as u32) else {
                        continue;
                    };
                    messages += 1;
                    schema.encode(&message, &mut bytes)?;
                    if !losses.chance(loss) {
                        rovers[to].receive(&message)?;
                    }
                }
            }
        }
        println!(
            "rows at a loss of {loss}: {messages} messages, {} bytes",
            bytes.len()
        );
    }
    let of_class = 4 * (1 + 2 * COLUMNS);
    let classes: usize = (1..=7).sum();
    let messages = ROVERS * (ROVERS - 1) * 7 * 20;
    let total = ROVERS * (ROVERS - 1) * 20 * classes * of_class;
    println!("sums, once at the end: {messages} messages, {total} bytes");
    println!("sums after each round: {} bytes", ROUNDS * total);
    Ok(())
}
