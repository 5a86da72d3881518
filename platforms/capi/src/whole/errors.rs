//! Conversions of the errors that only the whole library has.

use crate::error::Error;
use crate::error::vis_status::*;
use visibility_2d::cdt::PlanError;
use visibility_bake::BakedSetError;
use visibility_core::cells::CellGraphError;
use visibility_core::geometry::PolygonError;
use visibility_core::pvs::PvsError;
use visibility_core::who_sees::OfPortalsError;
use visibility_frame::casters::LightError;
use visibility_frame::queries::RayError;
use visibility_measure::MeasureError;
use visibility_occluders::{LevelFileError, LevelOccludersError};
use visibility_portals::from_geometry::GeometryError;
use visibility_portals::prt::PrtError;
use visibility_portals::{BakeError, SceneCellsError};

codes! {
    MeasureError, _ => VIS_ERROR_ARGUMENT;
    CellGraphError, _ => VIS_ERROR_ARGUMENT;
    PolygonError, _ => VIS_ERROR_ARGUMENT;
    BakeError, _ => VIS_ERROR_ARGUMENT;
    GeometryError, _ => VIS_ERROR_ARGUMENT;
    LevelOccludersError, _ => VIS_ERROR_ARGUMENT;
    LightError, _ => VIS_ERROR_ARGUMENT;
    RayError, _ => VIS_ERROR_ARGUMENT;
    LevelFileError, _ => VIS_ERROR_FORMAT;
    OfPortalsError, _ => VIS_ERROR_ARGUMENT;
    PlanError, kind => match kind {
        PlanError::UnknownWall { .. } => VIS_ERROR_UNKNOWN_ID,
        _ => VIS_ERROR_ARGUMENT,
    };
    PrtError, _ => VIS_ERROR_FORMAT;
    SceneCellsError, kind => match kind {
        SceneCellsError::UnknownCell(_)
        | SceneCellsError::UnknownPortal(_)
        | SceneCellsError::UnknownMirror(_) => VIS_ERROR_UNKNOWN_ID,
        _ => VIS_ERROR_ARGUMENT,
    };
    PvsError, kind => match kind {
        PvsError::Format(_) | PvsError::Row { .. } => VIS_ERROR_FORMAT,
        _ => VIS_ERROR_ARGUMENT,
    };
    BakedSetError, kind => match kind {
        BakedSetError::OtherScene | BakedSetError::OtherVersion { .. } => VIS_ERROR_ARGUMENT,
        _ => VIS_ERROR_FORMAT,
    };
}
