//! Temporary: how well classes are learnt in synthetic fields.
#[path = "support/synthetic.rs"]
mod synthetic;
use farside::random::RandomKey;
use farside_misus::analysis::{mixture::*, rocks::Rocks, scores::*};
use synthetic::*;

fn main() {
    let basis = basis();
    let arg = |i: usize, d: f64| std::env::args().nth(i).map_or(d, |a| a.parse().unwrap());
    let settings = FitSettings {
        position_weight: arg(1, 0.5),
        shrinkage: arg(2, 5.0),
        weight_prior: arg(3, 0.5),
        least_spread: arg(4, 0.02),
        ..FitSettings::default()
    };
    let rocks = arg(5, 90.0) as usize;
    let mut aris = vec![];
    let mut ks = vec![];
    for seed in 0..30 {
        let field = field(seed, rocks, 4, seed % 3 == 0);
        let mut s = RandomKey::new(seed).text("noise").stream();
        let rows: Vec<_> = (0..rocks)
            .map(|i| read(&field, &basis, i, 0.01, &mut s))
            .collect();
        let rocks = Rocks::pool(&rows);
        let fit = fit(rocks.table(), &settings).unwrap();
        let k = fit.mixture.classes();
        aris.push(adjusted_rand_index(
            &hard(&fit.responsibilities, k),
            &field.class,
        ));
        ks.push(k);
    }
    println!("{:?}", ks);
    println!(
        "{}",
        aris.iter()
            .map(|a| format!("{a:.2}"))
            .collect::<Vec<_>>()
            .join(" ")
    );
    let mean = aris.iter().sum::<f64>() / 30.0;
    aris.sort_by(f64::total_cmp);
    println!("mean {mean:.4} worst decile {:.3}", aris[2]);
}
