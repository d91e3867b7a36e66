//! The list of makers and models.

use crate::maker::MakerModel;
use crate::{hesai, livox, ouster, robosense, velodyne};

/// A supported LiDAR model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Model {
    /// A Velodyne.
    Velodyne(velodyne::Model),
    /// A Hesai.
    Hesai(hesai::Model),
    /// An Ouster OS0, OS1 or OS2. Its metadata file has the number of beams and the packet format.
    Ouster,
    /// A Robosense.
    Robosense(robosense::Model),
    /// A Livox.
    Livox(livox::Model),
}

impl Model {
    /// All models.
    pub const ALL: [Model; 12] = [
        Model::Velodyne(velodyne::Model::Hdl32e),
        Model::Velodyne(velodyne::Model::Vlp16),
        Model::Velodyne(velodyne::Model::Vlp32c),
        Model::Velodyne(velodyne::Model::Hdl64e),
        Model::Hesai(hesai::Model::Pandar40p),
        Model::Hesai(hesai::Model::PandarXt32),
        Model::Hesai(hesai::Model::PandarQt64),
        Model::Ouster,
        Model::Robosense(robosense::Model::Rs16),
        Model::Robosense(robosense::Model::Rs32),
        Model::Livox(livox::Model::Mid360),
        Model::Livox(livox::Model::Avia),
    ];

    /// The properties that the folder of its maker provides.
    pub(crate) fn maker(&self) -> &dyn MakerModel {
        match self {
            Model::Velodyne(model) => model,
            Model::Hesai(model) => model,
            Model::Ouster => &ouster::Model,
            Model::Robosense(model) => model,
            Model::Livox(model) => model,
        }
    }

    /// Name in `drive.toml`.
    pub fn name(self) -> &'static str {
        self.maker().name()
    }

    /// Name of the manufacturer.
    pub fn title(self) -> &'static str {
        self.maker().title()
    }

    /// The model with this name.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|model| model.name() == name)
    }

    /// The names of all models, separated by commas.
    pub fn names() -> String {
        Self::ALL.map(Model::name).join(", ")
    }

    /// Model that sent a data packet. `None` for packets of an Ouster, which do not name it.
    pub fn from_payload(payload: &[u8]) -> Option<Self> {
        Self::ALL.into_iter().find(|model| model.maker().is_named_by(payload))
    }

    /// Whether a payload is a data packet of a supported maker whose packets can be recognized.
    pub(crate) fn is_data(payload: &[u8]) -> bool {
        Self::ALL.iter().any(|model| model.maker().is_data_of_maker(payload))
    }

    /// Whether a payload may be a data packet of some supported LiDAR.
    pub fn may_be_data(payload: &[u8]) -> bool {
        Self::is_data(payload) || Self::may_be_ouster(payload)
    }

    /// Whether a payload has the size of a data packet of some Ouster.
    pub(crate) fn may_be_ouster(payload: &[u8]) -> bool {
        ouster::is_common_size(payload.len())
    }

    /// Whether a payload has the state of a device of some maker.
    pub(crate) fn is_device_packet(payload: &[u8]) -> bool {
        Self::ALL.iter().any(|model| model.maker().is_device_packet(payload))
    }

    /// UDP port of data packets, as set by the manufacturer.
    pub fn data_port(self) -> u16 {
        self.maker().data_port()
    }

    /// UDP port of other packets of the sensor.
    pub(crate) fn auxiliary_port(self) -> u16 {
        self.maker().auxiliary_port()
    }
}

impl From<velodyne::Model> for Model {
    fn from(model: velodyne::Model) -> Self {
        Model::Velodyne(model)
    }
}

impl From<hesai::Model> for Model {
    fn from(model: hesai::Model) -> Self {
        Model::Hesai(model)
    }
}

impl From<robosense::Model> for Model {
    fn from(model: robosense::Model) -> Self {
        Model::Robosense(model)
    }
}

impl From<livox::Model> for Model {
    fn from(model: livox::Model) -> Self {
        Model::Livox(model)
    }
}
