//! The coordinates of the delivery, and whether the run determines them.

use super::Args;
use super::source::Source;
use anyhow::{bail, ensure};
use command_line::argument::InvalidValue;
use command_line::say_error;
use command_line::usage_error::UsageError;
use doubts::{DoubtKind, Severity};
use formats::gtx::GeoidGrid;
use geometry::{Geodetic, LocalFrame};
use run::health::ReportedDoubt;
use run::summary::Summary;
use std::str::FromStr;
use surveying::crs::{Crs, CrsError, MARGIN_DEG};
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
    /// Where the drive is outside of the area of use of the reference system and its margin, if `--force-crs` or `--crs auto`
    /// accepts that.
    pub outside_area: Option<String>,
}

impl ChosenFrame<'_> {
    /// Note about the coordinates for readers of the files; empty = nothing.
    pub fn note(&self) -> String {
        match (&self.unreferenced, &self.outside_area) {
            (Some(reasons), _) => format!("not georeferenced: {reasons}"),
            (None, Some(place)) => place.clone(),
            (None, None) => String::new(),
        }
    }
}

/// Fails if the source does not determine the coordinates that are wanted, unless that is allowed.
pub fn choose<'a>(args: &Args, source: &'a Source) -> anyhow::Result<ChosenFrame<'a>> {
    let Source { runs, unplaced, .. } = source;
    let run = &runs[0];
    let georeference = run.georeference.as_ref();
    let local =
        |unreferenced| ChosenFrame { target: TargetFrame::local(georeference), unreferenced, outside_area: None };
    let is_epsg = matches!(args.crs, CrsChoice::Epsg(_));
    ensure!(is_epsg || !args.force_crs, UsageError("--force-crs: needs --crs EPSG:N".into()));
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
    if let (CrsChoice::Auto, false, Some(origin)) = (args.crs, args.allow_unreferenced, origin(run))
        && let Err(error) = Crs::utm_of(&origin)
    {
        bail!("{}: --crs auto: {error}\nhint: {POLAR}", args.run.display());
    }
    let mut frame = projected_or_local(run, unplaced, wanted, geoid)?;
    if let Some((crs, _)) = frame.target.crs()
        && let Some(place) = runs.iter().find_map(|run| place_outside(run, crs))
    {
        let text = outside_text(crs, &place);
        // A place outside of the margin comes first.
        let is_near = crs.area().contains_with_margin(&place);
        if is_epsg && !is_near && !args.force_crs {
            return Err(UsageError(format!("--crs: {text}; {}", systems_that_fit(crs, &place))).into());
        }
        // Without --crs, a drive may cross the edge of its zone.
        if is_epsg || !is_near {
            say_error!("warning: {text}");
        }
        frame.outside_area = Some(text).filter(|_| !is_near);
    }
    match &frame.unreferenced {
        Some(reasons) if !args.allow_unreferenced => bail!(
            "{}: {reasons}\nhint: --allow-unreferenced writes local coordinates without coordinate reference system",
            args.run.display()
        ),
        _ => Ok(frame),
    }
}

/// Where the clouds of a run near a pole can be delivered.
const POLAR: &str = "--crs local writes east, north, up at the origin, which delivery.json states; PROJ converts these to a polar \
                     system such as EPSG:5041 (WGS 84 / UPS North) or EPSG:5042 (UPS South)";

fn origin(run: &RunFolder) -> Option<Geodetic> {
    run.georeference.as_ref().and_then(Georeference::local).map(LocalFrame::origin)
}

/// The origin and the path of the vehicle. Empty if the run is not placed on the Earth.
fn path(run: &RunFolder) -> impl Iterator<Item = Geodetic> + '_ {
    let local = run.georeference.as_ref().and_then(Georeference::local);
    let poses = local.into_iter().flat_map(move |local| {
        let poses = run.trajectory.poses().iter();
        poses.map(move |(_, pose)| local.geodetic_from_world(&pose.translation.vector.into()))
    });
    origin(run).into_iter().chain(poses)
}

/// A place of the drive outside of the area of use of a system: outside of the margin if there is one, else outside of the
/// area itself.
fn place_outside(run: &RunFolder, crs: &Crs) -> Option<Geodetic> {
    let area = crs.area();
    let far = path(run).find(|place| !area.contains_with_margin(place));
    far.or_else(|| path(run).find(|place| !area.contains(place)))
}

fn outside_text(crs: &Crs, place: &Geodetic) -> String {
    let [latitude_margin, longitude_margin] = MARGIN_DEG;
    format!(
        "EPSG:{} ({}) is for {} degrees, with a margin of {latitude_margin} and {longitude_margin} degrees; the drive is at latitude \
         {:.6} longitude {:.6}",
        crs.epsg(),
        crs.name(),
        crs.area(),
        place.latitude_deg,
        place.longitude_deg
    )
}

/// The systems to use at a place instead of this one, and how.
fn systems_that_fit(crs: &Crs, place: &Geodetic) -> String {
    let fitting = Crs::containing(place);
    let names: Vec<String> = fitting.iter().map(|fits| format!("EPSG:{} ({})", fits.epsg(), fits.name())).collect();
    let force = format!("--force-crs writes EPSG:{} nevertheless", crs.epsg());
    match fitting.first() {
        Some(first) => format!("systems that fit: {}\nhint: --crs EPSG:{}; {force}", names.join(", "), first.epsg()),
        None => format!("no supported system fits, UTM ends at latitudes -80 and 84\nhint: {POLAR}; {force}"),
    }
}

/// The UTM zone of the place, or local coordinates if the run does not determine it.
pub fn utm_or_local<'a>(run: &'a RunFolder, summary: &Summary) -> anyhow::Result<ChosenFrame<'a>> {
    projected_or_local(run, &unplaced(summary), None, None)
}

fn projected_or_local<'a>(
    run: &'a RunFolder,
    unplaced: &[String],
    wanted: Option<Crs>,
    geoid: Option<(String, GeoidGrid)>,
) -> anyhow::Result<ChosenFrame<'a>> {
    let georeference = run.georeference.as_ref();
    let origin = origin(run);
    let local = |reasons| ChosenFrame {
        target: TargetFrame::local(georeference),
        unreferenced: Some(reasons),
        outside_area: None,
    };
    match (not_determined(origin.is_some(), unplaced), georeference, origin) {
        (None, Some(georeference), Some(origin)) => {
            let crs = match wanted.map_or_else(|| Crs::utm_of(&origin), Ok) {
                // Near the poles.
                Err(CrsError::Utm(error)) => return Ok(local(error.to_string())),
                found => found?,
            };
            let target = TargetFrame::projected(georeference, crs, geoid)?;
            Ok(ChosenFrame { target, unreferenced: None, outside_area: None })
        }
        (reasons, ..) => Ok(local(reasons.unwrap_or_default())),
    }
}

/// Why the run does not determine coordinates on the Earth.
fn not_determined(is_placed: bool, unplaced: &[String]) -> Option<String> {
    if !is_placed {
        return Some("the run is not placed on the Earth: it has no origin in georeference.json".to_owned());
    }
    (!unplaced.is_empty()).then(|| unplaced.join("; "))
}

/// The doubts of a run that make its place on the Earth unknown.
pub fn unplaced(summary: &Summary) -> Vec<String> {
    let is_unplaced = |doubt: &&ReportedDoubt| doubt.kind().map(DoubtKind::severity) == Some(Severity::Unplaced);
    summary.doubts().map(|(_, doubt)| doubt).filter(is_unplaced).map(|doubt| doubt.text.clone()).collect()
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
