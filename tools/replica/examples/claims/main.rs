//! Claims of the thesis on data of our own: one table for each, in minutes (docs/claims.md has them all beside the thesis').
//!
//! `cargo run --release -p replica --example claims -- CLAIM [SEEDS]`, with three seeds unless said otherwise.
//!
//! | claim | thesis | data |
//! |---|---|---|
//! | `minimum` | section 5.5.3, figure 5.4 | none |
//! | `mnist-binary`, `mnist-multiclass` | tables 5.1 and 5.2 | `mnist/` of the real data (`tests/real_data`) |
//! | `slice-low`, `slice-high` | tables 5.6 and 5.7 | top-down views of simulated towns |
//! | `transfer` | table 6.6 | sweeps of simulated towns by two sensors |
//! | `hierarchy` | tables 6.9 and 6.10 | sweeps of simulated towns |
//! | `specialized` | table 6.8 | the same |
//! | `color` | table 6.12 | the same |

mod minimum;
mod mnist;
mod slices;
mod streets;
mod training;

fn main() -> anyhow::Result<()> {
    let mut args = std::env::args().skip(1);
    let claim = args.next().unwrap_or_default();
    let n_seeds: u64 = args.next().map_or(Ok(3), |n| n.parse())?;
    match claim.as_str() {
        "minimum" => minimum::run(),
        "mnist-binary" => mnist::run(true, n_seeds)?,
        "mnist-multiclass" => mnist::run(false, n_seeds)?,
        "slice-low" => slices::run(slices::LOW, n_seeds)?,
        "slice-high" => slices::run(slices::HIGH, n_seeds)?,
        "transfer" => streets::transfer::run(n_seeds)?,
        "hierarchy" => streets::hierarchy(n_seeds)?,
        "specialized" => streets::specialized(n_seeds)?,
        "color" => streets::color(n_seeds)?,
        other => anyhow::bail!("no claim {other:?}\nhint: see the head of examples/claims/main.rs"),
    }
    Ok(())
}
