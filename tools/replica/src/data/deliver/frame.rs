//! The coordinates of the delivery, and whether the run determines them.

use super::Args;
use super::source::Source;
use anyhow::{bail, ensure};
use command_line::argument::InvalidValue;
use command_line::say_error;
use command_line::usage_error::UsageError;
use doubts::{DoubtKind, Severity};
use formats::gtx::GeoidGrid;
use formats::ntv2::DatumGrid;
use geometry::{Geodetic, LocalFrame};
use run::health::ReportedDoubt;
use run::summary::Summary;
use std::path::Path;
use std::str::FromStr;
use std::sync::Arc;
use surveying::crs::{Area, Crs, CrsCode, CrsError, HeightSystem, MARGIN_DEG, Named, VerticalDatum};
use surveying::{Georeference, MapChoice, RunFolder, TargetFrame};

/// The argument `--crs`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CrsChoice {
    /// The UTM zone of the place.
    Auto,
    /// East, north, up at the origin of the run.
    Local,
    /// The reference system with this EPSG number.
    Epsg(CrsCode),
}

impl FromStr for CrsChoice {
    type Err = InvalidValue;

    fn from_str(text: &str) -> Result<Self, InvalidValue> {
        match text {
            "auto" => Ok(Self::Auto),
            "local" => Ok(Self::Local),
            _ => text.parse().map(Self::Epsg).map_err(|_| InvalidValue("auto, local, EPSG:N or EPSG:N+M")),
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
        for (option, is_given) in [("--geoid", args.geoid.is_some()), ("--grid", args.grid.is_some())] {
            let rule = format!("{option}: needs a coordinate reference system, not --crs local");
            ensure!(!is_given, UsageError(rule));
        }
        return Ok(local(None));
    }
    ensure!(is_epsg || args.grid.is_none(), UsageError("--grid: needs --crs EPSG:N".into()));
    let wanted = match args.crs {
        CrsChoice::Epsg(code) => Some(open_system(code, args.geoid.as_deref(), args.grid.as_deref())?),
        _ => None,
    };
    let geoid = if wanted.is_none() { args.geoid.as_deref().map(load_geoid).transpose()? } else { None };
    if let (CrsChoice::Auto, false, Some(origin)) = (args.crs, args.allow_unreferenced, origin(run))
        && let Err(error) = Crs::utm_of(&origin)
    {
        bail!("{}: --crs auto: {error}\nhint: {POLAR}", args.run.display());
    }
    let mut frame = projected_or_local(run, unplaced, wanted, geoid)?;
    if let Some((crs, vertical)) = frame.target.crs()
        && let Some((system, place)) = runs.iter().find_map(|run| outside(run, crs, vertical))
    {
        let text = outside_text(&system, &place);
        // A place outside of the margin comes first.
        let is_near = system.area.contains_with_margin(&place);
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
const POLAR: &str = "--crs EPSG:5041 (WGS 84 / UPS North) or EPSG:5042 (UPS South) is for the poles; --crs local writes east, north, up at \
                     the origin, which delivery.json states";

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

/// A system of the delivery, horizontal or vertical.
struct System<'a> {
    epsg: u32,
    name: &'static str,
    area: &'a Area,
}

/// The first system of which the drive leaves the area of use, and a place there: outside of the margin if there is one, else outside of
/// the area itself.
fn outside<'a>(run: &RunFolder, crs: &'a Crs, vertical: &'a VerticalDatum) -> Option<(System<'a>, Geodetic)> {
    let horizontal = System { epsg: crs.epsg(), name: crs.name(), area: crs.area() };
    let height = match vertical {
        VerticalDatum::Registered(height) => {
            Some(System { epsg: height.epsg(), name: height.name(), area: height.area() })
        }
        VerticalDatum::Ellipsoid | VerticalDatum::Geoid(_) => None,
    };
    let mut found = None;
    for system in [Some(horizontal), height].into_iter().flatten() {
        if let Some(place) = path(run).find(|place| !system.area.contains_with_margin(place)) {
            return Some((system, place));
        }
        let near = path(run).find(|place| !system.area.contains(place));
        found = found.or(near.map(|place| (system, place)));
    }
    found
}

fn outside_text(System { epsg, name, area }: &System<'_>, place: &Geodetic) -> String {
    let [latitude_margin, longitude_margin] = MARGIN_DEG;
    format!(
        "EPSG:{epsg} ({name}) is for {area} degrees, with a margin of {latitude_margin} and {longitude_margin} degrees; the drive is at \
         latitude {:.6} longitude {:.6}",
        place.latitude_deg, place.longitude_deg
    )
}

/// The systems to use at a place instead of this one, and how.
fn systems_that_fit(crs: &Crs, place: &Geodetic) -> String {
    let fitting = Crs::containing(place);
    let names: Vec<String> = fitting.iter().map(|fits| format!("EPSG:{} ({})", fits.epsg(), fits.name())).collect();
    let force = format!("--force-crs writes EPSG:{} nevertheless", crs.epsg());
    match fitting.first() {
        Some(first) => format!("systems that fit: {}\nhint: --crs EPSG:{}; {force}", names.join(", "), first.epsg()),
        None => format!("no system of the registry fits\nhint: {POLAR}; {force}"),
    }
}

/// The UTM zone of the place, or local coordinates if the run does not determine it.
pub fn utm_or_local<'a>(run: &'a RunFolder, summary: &Summary) -> anyhow::Result<ChosenFrame<'a>> {
    projected_or_local(run, &unplaced(summary), None, None)
}

/// The system of a code with its files. A wrong choice is an error of usage, an unreadable file is not.
pub fn open_system(code: CrsCode, geoid: Option<&Path>, grid: Option<&Path>) -> anyhow::Result<MapChoice> {
    let usage = |option: &str, error: &CrsError| UsageError(format!("{option}: {error}"));
    let crs = Crs::from_epsg(code.horizontal).map_err(|error| usage("--crs", &error))?;
    let height = code.height.map(HeightSystem::from_epsg).transpose().map_err(|error| usage("--crs", &error))?;
    let datum_grid =
        grid.map(|path| Ok::<_, anyhow::Error>(Arc::new(named(path, DatumGrid::load(path)?)))).transpose()?;
    if let Err(error) = crs.projection(datum_grid.as_ref()) {
        let (option, hint) = match error {
            CrsError::NeedsGrid { .. } => ("--crs", GRID_HINT),
            _ => ("--grid", ""),
        };
        return Err(UsageError(format!("{option}: {error}{hint}")).into());
    }
    let geoid = geoid.map(load_geoid).transpose()?;
    if let Some(height) = &height {
        check_geoid(height, geoid.as_ref())?;
    }
    Ok(MapChoice { crs, height, geoid, datum_grid })
}

/// How to give a grid of a datum.
const GRID_HINT: &str = "\nhint: --grid FILE.gsb, under this name; the survey of the country publishes it, and Debian's package proj-data has \
                         BETA2007.gsb, CHENYX06_etrs.gsb and nzgd2kgrid0005.gsb; GeoTIFF files of PROJ are not read";

/// Heights of a system need its geoid grid.
fn check_geoid(height: &HeightSystem, geoid: Option<&Named<GeoidGrid>>) -> Result<(), UsageError> {
    let name = format!("EPSG:{} ({})", height.epsg(), height.name());
    let Some(geoid) = geoid else {
        let known = match height.grids() {
            [] => "the registry names none".to_owned(),
            grids => format!("PROJ has {}, from https://cdn.proj.org", grids.join(", ")),
        };
        return Err(UsageError(format!(
            "--crs: heights of {name} need its geoid grid; {known}\nhint: --geoid FILE.gtx; GDAL converts a GeoTIFF: `gdal_translate -b 1 \
             -of GTX FILE.tif FILE.gtx`"
        )));
    };
    match VerticalDatum::from_grid_name(&geoid.name) {
        VerticalDatum::Registered(other) if other.epsg() != height.epsg() => Err(UsageError(format!(
            "--geoid: {} has heights of EPSG:{} ({}), --crs wants heights of {name}",
            geoid.name,
            other.epsg(),
            other.name()
        ))),
        _ => Ok(()),
    }
}

fn load_geoid(path: &Path) -> anyhow::Result<Named<GeoidGrid>> {
    Ok(named(path, GeoidGrid::load(path)?))
}

fn named<G>(path: &Path, grid: G) -> Named<G> {
    Named { name: path.file_name().unwrap_or_default().to_string_lossy().into_owned(), grid }
}

fn projected_or_local<'a>(
    run: &'a RunFolder,
    unplaced: &[String],
    wanted: Option<MapChoice>,
    geoid: Option<Named<GeoidGrid>>,
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
            let in_utm = || Ok(MapChoice { geoid, ..MapChoice::from(Crs::utm_of(&origin)?) });
            let choice = match wanted.map_or_else(in_utm, Ok) {
                // Near the poles.
                Err(CrsError::Utm(error)) => return Ok(local(error.to_string())),
                found => found?,
            };
            let target = TargetFrame::projected(georeference, choice)?;
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
        let code = CrsCode { horizontal: 2154, height: None };
        assert_eq!("epsg:2154".parse::<CrsChoice>().expect("is one"), CrsChoice::Epsg(code));
        for text in ["", "2154", "EPSG:", "EPSG:x", "utm", "é:4326"] {
            assert!(text.parse::<CrsChoice>().is_err(), "{text}");
        }
    }
}
