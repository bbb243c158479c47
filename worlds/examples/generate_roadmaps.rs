//! Writes the built-in roadmaps to `worlds/data/`. A test compares the files with the generator, so
//! this is needed only after the generator has changed.
//!
//! ```text
//! cargo run -p farside-worlds --example generate_roadmaps
//! ```

use std::path::Path;

use farside_worlds::generate::builtin_file;
use farside_worlds::{Roadmap, WorldError};

fn main() -> Result<(), WorldError> {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("data");
    for name in Roadmap::builtin_names() {
        let text = builtin_file(name)?;
        let map = Roadmap::from_toml(&text)?;
        let path = data.join(format!("{name}.toml"));
        std::fs::write(&path, text).expect("worlds/data is writable");
        println!(
            "{name}: {} vertices, {} edges, {} on the boundary, diameter {}",
            map.len(),
            map.edge_count(),
            map.boundary().len(),
            map.diameter()
        );
    }
    Ok(())
}
