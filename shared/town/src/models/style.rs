//! Styles of houses: fixed properties and random ones.

use super::wall::FLOOR_M;
use crate::material::Material;
use random::Random;

/// Appearance and measures of the fronts of a house, m.
#[derive(Clone, Copy, Debug)]
#[allow(clippy::struct_excessive_bools, reason = "each is an optional ornament of a house")]
pub struct Style {
    /// Material of the wall above the ground floor.
    pub wall: Material,
    /// Material of the wall of the ground floor.
    pub base: Material,
    /// Material of mouldings, sills, surrounds and balcony slabs.
    pub trim: Material,
    /// Material of window frames.
    pub frame: Material,
    /// Material of doors.
    pub door: Material,
    /// Material of open shutters at the windows.
    pub shutters: Option<Material>,
    /// Approximate spacing of windows.
    pub bay_m: f32,
    /// Width and height of windows and their height above the floor; width 0 = no windows.
    pub window: [f32; 3],
    /// Height of the ground floor.
    pub ground_m: f32,
    /// Height of each floor above it.
    pub storey_m: f32,
    /// Whether the ground floor has shops.
    pub shops: bool,
    /// Position of the balconies.
    pub balconies: Balconies,
    /// Railing of the balconies.
    pub rail: Rail,
    /// Whether windows have a stone frame.
    pub surrounds: bool,
    /// Whether a moulding runs above each floor.
    pub courses: bool,
    /// Whether the corners have protruding stones.
    pub quoins: bool,
    /// Protrusion of the cornice under the roof; 0 = no cornice.
    pub cornice_m: f32,
    /// Depth of windows in the wall.
    pub recess_m: f32,
    /// Largest deviation of the wall from its plane.
    pub uneven_m: f32,
    /// The roof.
    pub roof: Roof,
    /// Whether it has chimneys.
    pub chimneys: bool,
}

/// Position of the balconies of a house.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Balconies {
    /// No balconies.
    None,
    /// At every other window above the ground floor.
    Alternate,
    /// Along the whole front on the second and the last but one floor.
    Continuous,
    /// At all windows above the ground floor, 1.2 m deep.
    Loggias,
}

/// A balcony's railing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rail {
    /// Iron bars; rays pass between them.
    Bars,
    /// Panes.
    Glass,
    /// A slab.
    Solid,
}

/// Kinds of roofs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Roof {
    /// Steep below and shallow above, with dormers.
    Mansard,
    /// Two slopes with a ridge along the front.
    Gabled,
    /// Behind a parapet.
    Flat,
}

impl Style {
    /// Style of a house between others in a town.
    pub fn urban(random: &mut Random) -> Self {
        let styles: [fn(&mut Random) -> Self; 7] =
            [Self::haussmann, Self::haussmann, Self::faubourg, Self::faubourg, Self::brick, Self::modern, Self::office];
        random.pick(&styles)(random)
    }

    /// Dressed limestone, iron balconies along the front, zinc mansards: Paris after 1853.
    pub fn haussmann(random: &mut Random) -> Self {
        let wall = *random.pick(&[Material::LimestoneDressed, Material::Limestone, Material::PlasterCream]);
        Self {
            wall,
            base: Material::Limestone,
            trim: Material::LimestoneDressed,
            frame: Material::WoodWhite,
            door: *random.pick(&[Material::WoodGreen, Material::WoodBlue, Material::Wood]),
            shutters: None,
            bay_m: random.range(2.4, 2.9),
            window: [1.15, 2.2, 0.35],
            ground_m: random.range(3.6, 4.1),
            storey_m: random.range(3.0, 3.3),
            shops: random.chance(0.7),
            balconies: Balconies::Continuous,
            rail: Rail::Bars,
            surrounds: true,
            courses: true,
            quoins: false,
            cornice_m: 0.45,
            recess_m: 0.28,
            uneven_m: 0.025,
            roof: Roof::Mansard,
            chimneys: true,
        }
    }

    /// Old plastered houses of different heights, out of plumb by centimetres.
    pub fn faubourg(random: &mut Random) -> Self {
        let wall = *random.pick(&[
            Material::PlasterCream,
            Material::PlasterGray,
            Material::PlasterRose,
            Material::PlasterOchre,
            Material::PlasterWhite,
        ]);
        let paint = [Material::WoodGreen, Material::WoodBlue, Material::WoodWhite, Material::Wood, Material::WoodRed];
        Self {
            wall,
            base: if random.chance(0.3) { Material::Fieldstone } else { wall },
            trim: *random.pick(&[Material::PlasterGray, Material::LimestoneDressed]),
            frame: Material::WoodWhite,
            door: *random.pick(&paint),
            shutters: if random.chance(0.6) { Some(*random.pick(&paint)) } else { None },
            bay_m: random.range(2.6, 3.4),
            window: [random.range(0.95, 1.15), random.range(1.5, 1.8), 0.8],
            ground_m: random.range(3.0, 3.6),
            storey_m: random.range(2.6, 3.0),
            shops: random.chance(0.5),
            balconies: if random.chance(0.3) { Balconies::Alternate } else { Balconies::None },
            rail: Rail::Bars,
            surrounds: random.chance(0.4),
            courses: random.chance(0.4),
            quoins: random.chance(0.3),
            cornice_m: random.range(0.1, 0.3),
            recess_m: 0.2,
            uneven_m: 0.045,
            roof: *random.pick(&[Roof::Gabled, Roof::Gabled, Roof::Mansard]),
            chimneys: true,
        }
    }

    /// Brick with stone sills and lintels.
    pub fn brick(random: &mut Random) -> Self {
        Self {
            wall: *random.pick(&[Material::Brick, Material::Brick, Material::BrickYellow]),
            base: *random.pick(&[Material::Brick, Material::Fieldstone]),
            trim: Material::LimestoneDressed,
            frame: Material::WoodWhite,
            door: *random.pick(&[Material::WoodRed, Material::WoodGreen, Material::WoodBlue]),
            shutters: None,
            bay_m: random.range(2.5, 3.2),
            window: [1.1, 1.75, 0.75],
            ground_m: 3.3,
            storey_m: random.range(2.8, 3.1),
            shops: random.chance(0.35),
            balconies: if random.chance(0.25) { Balconies::Alternate } else { Balconies::None },
            rail: Rail::Bars,
            surrounds: true,
            courses: random.chance(0.5),
            quoins: random.chance(0.5),
            cornice_m: 0.2,
            recess_m: 0.16,
            uneven_m: 0.02,
            roof: *random.pick(&[Roof::Gabled, Roof::Flat]),
            chimneys: true,
        }
    }

    /// Concrete, wide windows, deep balconies, flat roofs: since 1960.
    pub fn modern(random: &mut Random) -> Self {
        let wall =
            *random.pick(&[Material::ConcreteNew, Material::Concrete, Material::PlasterWhite, Material::Cladding]);
        Self {
            wall,
            base: *random.pick(&[Material::Concrete, Material::Cladding, wall]),
            trim: Material::ConcreteNew,
            frame: *random.pick(&[Material::DarkMetal, Material::WhitePlastic]),
            door: Material::DarkMetal,
            shutters: None,
            bay_m: random.range(3.2, 4.0),
            window: [random.range(1.8, 2.4), 1.6, 0.75],
            ground_m: 3.2,
            storey_m: 2.8,
            shops: random.chance(0.4),
            balconies: *random.pick(&[Balconies::None, Balconies::Loggias, Balconies::Loggias]),
            rail: *random.pick(&[Rail::Glass, Rail::Solid, Rail::Bars]),
            surrounds: false,
            courses: random.chance(0.3),
            quoins: false,
            cornice_m: 0.0,
            recess_m: 0.14,
            uneven_m: 0.012,
            roof: Roof::Flat,
            chimneys: false,
        }
    }

    /// Wide panes between metal.
    pub fn office(random: &mut Random) -> Self {
        Self {
            wall: Material::Cladding,
            base: Material::Granite,
            frame: Material::DarkMetal,
            bay_m: 3.0,
            window: [2.6, 2.4, 0.35],
            ground_m: 4.0,
            storey_m: 3.3,
            shops: random.chance(0.5),
            balconies: Balconies::None,
            courses: true,
            recess_m: 0.1,
            uneven_m: 0.008,
            ..Self::modern(random)
        }
    }

    /// Walls without windows: barns and towers.
    pub fn blank(random: &mut Random, wall: Material, height_m: f32) -> Self {
        Self {
            wall,
            base: wall,
            window: [0.0, 0.0, 0.0],
            ground_m: height_m,
            surrounds: false,
            quoins: false,
            shutters: None,
            chimneys: false,
            ..Self::cottage(random)
        }
    }

    /// Style of a house with a garden.
    pub fn cottage(random: &mut Random) -> Self {
        let plaster = *random.pick(&[
            Material::PlasterCream,
            Material::PlasterWhite,
            Material::PlasterOchre,
            Material::PlasterRose,
            Material::PlasterBlue,
            Material::Brick,
            Material::Fieldstone,
        ]);
        Self {
            wall: plaster,
            base: plaster,
            bay_m: random.range(2.8, 3.6),
            window: [1.2, 1.3, 0.9],
            ground_m: 2.8,
            storey_m: 2.7,
            shops: false,
            balconies: Balconies::None,
            courses: false,
            cornice_m: 0.0,
            roof: Roof::Gabled,
            ..Self::faubourg(random)
        }
    }

    /// The plain style of backs and sides: no shops, balconies or ornament.
    #[must_use]
    pub const fn back(self) -> Self {
        Self { shops: false, balconies: Balconies::None, surrounds: false, quoins: false, shutters: None, ..self }
    }

    /// All floors of the same height.
    #[must_use]
    pub const fn even_storeys(self) -> Self {
        Self { ground_m: FLOOR_M, storey_m: FLOOR_M, ..self }
    }

    /// Height of the wall, m.
    pub fn height(&self, floors: usize) -> f32 {
        self.floor_z(floors)
    }

    /// Height of a floor above the foot of the house, m.
    pub fn floor_z(&self, floor: usize) -> f32 {
        if floor == 0 { 0.0 } else { self.ground_m + (floor - 1) as f32 * self.storey_m }
    }
}
