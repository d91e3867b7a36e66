//! The coordinates of the delivery, and whether the run determines them.

use super::Args;
use anyhow::{bail, ensure};
use command_line::argument::InvalidValue;
use command_line::usage_error::UsageError;
use doubts::{DoubtKind, Severity};
use formats::gtx::GeoidGrid;
use run::health::ReportedDoubt;
use run::summary::Summary;
use std::str::FromStr;
use surveying::crs::Crs;
use surveying::{Georeference, RunFolder, TargetFrame};

/// The argument `--crs`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CrsChoice {
    /// The UTM zone of the place.
    Auto,
    /// East, north, up at the origin of the run.
    Local,
    /// The reference system with this EPSG number.
    Epsg(u32),
}

impl FromStr for CrsChoice {
    type Err = InvalidValue;

    fn from_str(text: &str) -> Result<Self, InvalidValue> {
        let epsg =
            || text.get(..5).filter(|begin| begin.eq_ignore_ascii_case("epsg:")).and(text.get(5..)?.parse().ok());
        match text {
            "auto" => Ok(Self::Auto),
            "local" => Ok(Self::Local),
            _ => epsg().map(Self::Epsg).ok_or(InvalidValue("auto, local or EPSG:N")),
        }
    }
}

/// The coordinates of the delivery.
pub struct ChosenFrame<'a> {
    pub target: TargetFrame<'a>,
    /// Why they are local although a reference system was wanted.
    pub unreferenced: Option<String>,
}

impl ChosenFrame<'_> {
    /// Note about the coordinates for readers of the files; empty = nothing.
    pub fn note(&self) -> String {
        self.unreferenced.as_ref().map(|reasons| format!("not georeferenced: {reasons}")).unwrap_or_default()
    }
}

/// Fails if the run does not determine the coordinates that are wanted, unless that is allowed.
pub fn choose<'a>(args: &Args, run: &'a RunFolder, summary: &Summary) -> anyhow::Result<ChosenFrame<'a>> {
    let georeference = run.georeference.as_ref();
    let local = |unreferenced| ChosenFrame { target: TargetFrame::local(georeference), unreferenced };
    if args.crs == CrsChoice::Local {
        ensure!(
            args.geoid.is_none(),
            UsageError("--geoid: needs a coordinate reference system, not --crs local".into())
        );
        return Ok(local(None));
    }
    // Errors of files are reported before errors of the run.
    let geoid = match &args.geoid {
        None => None,
        Some(path) => {
            let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
            Some((name, GeoidGrid::load(path)?))
        }
    };
    let wanted = match args.crs {
        CrsChoice::Epsg(epsg) => Some(Crs::from_epsg(epsg).map_err(|error| UsageError(format!("--crs: {error}")))?),
        _ => None,
    };
    let frame = projected_or_local(run, summary, wanted, geoid)?;
    match &frame.unreferenced {
        Some(reasons) if !args.allow_unreferenced => bail!(
            "{}: {reasons}\nhint: --allow-unreferenced writes local coordinates without coordinate reference system",
            args.run.display()
        ),
        _ => Ok(frame),
    }
}

/// The UTM zone of the place, or local coordinates if the run does not determine it.
pub fn utm_or_local<'a>(run: &'a RunFolder, summary: &Summary) -> anyhow::Result<ChosenFrame<'a>> {
    projected_or_local(run, summary, None, None)
}

fn projected_or_local<'a>(
    run: &'a RunFolder,
    summary: &Summary,
    wanted: Option<Crs>,
    geoid: Option<(String, GeoidGrid)>,
) -> anyhow::Result<ChosenFrame<'a>> {
    let georeference = run.georeference.as_ref();
    let origin = georeference.and_then(Georeference::local).map(geometry::LocalFrame::origin);
    match (not_determined(origin.is_some(), summary), georeference, origin) {
        (None, Some(georeference), Some(origin)) => {
            let crs = wanted.map_or_else(|| Crs::utm_of(&origin), Ok)?;
            Ok(ChosenFrame { target: TargetFrame::projected(georeference, crs, geoid)?, unreferenced: None })
        }
        (reasons, ..) => {
            let unreferenced = Some(reasons.unwrap_or_default());
            Ok(ChosenFrame { target: TargetFrame::local(georeference), unreferenced })
        }
    }
}

/// Why the run does not determine coordinates on the Earth.
fn not_determined(is_placed: bool, summary: &Summary) -> Option<String> {
    if !is_placed {
        return Some("the run is not placed on the Earth: it has no origin in georeference.json".to_owned());
    }
    let is_unplaced = |doubt: &&ReportedDoubt| doubt.kind().map(DoubtKind::severity) == Some(Severity::Unplaced);
    let doubts = summary.doubts().map(|(_, doubt)| doubt).filter(is_unplaced);
    let texts: Vec<&str> = doubts.map(|doubt| doubt.text.as_str()).collect();
    (!texts.is_empty()).then(|| texts.join("; "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn choice_is_auto_local_or_a_number() {
        assert_eq!("auto".parse::<CrsChoice>().expect("is one"), CrsChoice::Auto);
        assert_eq!("epsg:2154".parse::<CrsChoice>().expect("is one"), CrsChoice::Epsg(2154));
        for text in ["", "2154", "EPSG:", "EPSG:x", "utm", "é:4326"] {
            assert!(text.parse::<CrsChoice>().is_err(), "{text}");
        }
    }
}
