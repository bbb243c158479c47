//! Measured spectra: classes hold rocks of one dominant mineral.

use farside::random::RandomKey;
use farside_misus::analysis::library::ReferenceLibrary;
use farside_misus::analysis::mixture::{FitSettings, Table, fit};
use farside_misus::analysis::scores::{hard, purity};
use farside_worlds::SpectralLibrary;

/// Clusters of the samples, read with 1 % of noise.
fn clusters(library: &SpectralLibrary, seed: u64) -> Vec<usize> {
    let basis = ReferenceLibrary::measured(library).basis().unwrap();
    let mut stream = RandomKey::new(seed).text("measured").stream();
    let mut table = Table::new(4, 0);
    for sample in library.samples() {
        let noisy = sample.reflectance.iter();
        let read: Vec<f64> = noisy
            .map(|r| r * (1.0 + stream.normal(0.0, 0.01)))
            .collect();
        let spectral = basis.features(&read, 0.01).unwrap();
        let sd = f64::from(spectral.noise_sd);
        table.push(&spectral.features.map(f64::from), &[sd * sd; 4]);
    }
    let fit = fit(&table, &FitSettings::default()).unwrap();
    hard(&fit.responsibilities, fit.mixture.classes())
}

#[test]
fn classes_of_measured_spectra_have_a_dominant_mineral() {
    let library = SpectralLibrary::builtin();
    let minerals: Vec<usize> = library.samples().map(|s| s.dominant_mineral()).collect();
    let (mut purities, mut shuffled) = (Vec::new(), Vec::new());
    for seed in 0..5 {
        let clusters = clusters(&library, seed);
        assert!(clusters.iter().max() < Some(&10));
        purities.push(purity(&clusters, &minerals));
        let mut labels = minerals.clone();
        RandomKey::new(seed)
            .text("shuffled")
            .stream()
            .shuffle(&mut labels);
        shuffled.push(purity(&clusters, &labels));
    }
    purities.sort_by(f64::total_cmp);
    shuffled.sort_by(f64::total_cmp);
    println!("purity {purities:.3?}, of shuffled labels {shuffled:.3?}");
    assert!(purities[2] >= 0.8, "{purities:?}");
    assert!(shuffled[2] < 0.6, "{shuffled:?}");
}
