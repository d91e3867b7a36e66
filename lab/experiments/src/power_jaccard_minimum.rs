//! Minimum of the loss `J_p` of one pixel of the class (section 5.5.3, eq. 5.6): by search, and by the thesis' root of the
//! derivative.

/// Steps of the search from 0 to 2.
const STEPS: u32 = 200_000;

/// Loss of one pixel with y = 1, eq. (5.3).
fn loss(p: f64, power: f64) -> f64 {
    1.0 - p / (1.0 + p.powf(power) - p)
}

/// Prints a table with one row per power.
pub fn run() {
    println!("| power | least at | (1 / (p - 1))^(1 / p) | loss there | loss at 1 |\n|---|---|---|---|---|");
    for power in [1.0, 1.1, 1.25, 1.5, 1.75, 1.9, 2.0, 2.25, 2.5, 3.0, 4.0, 5.0] {
        let at = |i: u32| 2.0 * f64::from(i) / f64::from(STEPS);
        // Without a minimum the search returns its upper end. A pole between 1 and 2 is ignored: probabilities are at most 1.
        let least = (0..=STEPS).map(at).min_by(|a, b| loss(*a, power).total_cmp(&loss(*b, power))).unwrap_or(0.0);
        let root = if power > 1.0 { format!("{:.4}", (1.0 / (power - 1.0_f64)).powf(1.0 / power)) } else { "-".into() };
        let found = if least < 2.0 { format!("{least:.4}") } else { "none up to 2".into() };
        println!("| {power} | {found} | {root} | {:.4} | {:.4} |", loss(least, power), loss(1.0, power));
    }
}
