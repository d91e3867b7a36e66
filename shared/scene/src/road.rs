//! The driven streets as roads: cross sections along the path, lanes, and ASAM OpenDRIVE.

mod cross_section;
mod lanes;
mod lines;
mod opendrive;
mod path;
mod strip;

pub use cross_section::{CrossSection, Marking, SideSection, along_m, cross_sections};
pub use lanes::{Boundary, Lane, LaneKind, LaneSection, Mark, Traffic, lane_sections};
pub use lines::{RoadLine, RoadLineKind, road_lines};
pub use opendrive::{RoadNetwork, RoadSummary, opendrive};
pub use path::{DrivenRoad, Station, driven_roads};
pub use strip::RoadStrips;
