use rig::check::Report;
use rig::survey::{Survey, SurveySettings};
fn main() {
    let folder = std::env::args().nth(1).unwrap();
    let t = std::time::Instant::now();
    let drive = formats::drive::Drive::open(folder.as_ref()).unwrap();
    let survey = Survey::of(&drive, &SurveySettings::default()).unwrap();
    println!("survey {:.1} s, {} sweeps, bridged {:.2}, {} ground of {}", t.elapsed().as_secs_f64(), survey.poses.len(), survey.bridged_share(), survey.ground.len(), survey.n_ground_searches);
    let t = std::time::Instant::now();
    let report = Report::of(&drive, &survey, None);
    for v in &report.verdicts { println!("{v}"); }
    println!("report {:.1} s", t.elapsed().as_secs_f64());
    if let Some(check) = &survey.inertial { for l in check.summary() { println!("{l}"); } }
    for (i, e) in survey.ring_errors.iter().enumerate() { print!("{i}:{:.4}±{:.4} ", e.mean.to_degrees(), e.variance.sqrt().to_degrees()); }
    println!();
}
