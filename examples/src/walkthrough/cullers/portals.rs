//! Command-line entry of the portal culler.

use super::known::Known;
use crate::walkthrough::World;
use visibility_core::Culler;
use visibility_portals::{Narrowing, PortalCuller, PortalEye, SceneCells};

pub(super) const KNOWN: &[Known] = &[Known {
    name: "portals",
    what: "what is not seen through the portals of the scene's cells is hidden (cells given, or made by the \
           program); portals:rectangle narrows each to a rectangle of the screen",
    dials: &["polygon", "rectangle"],
    make: |dial, world| Ok(Box::new(portals(dial, world)?) as Box<dyn Culler + Send + Sync>),
}];

/// Makes the portal culler of a world. The setting (dial) is `polygon` or `rectangle`, the shape to which
/// each portal narrows the view; without a setting, it is `polygon`.
///
/// # Errors
///
/// Returns a message if the setting is unknown, or the world has no cells or unusable ones.
pub fn portals(dial: Option<&str>, world: &World) -> Result<PortalCuller, String> {
    let narrowing = match dial {
        None | Some("polygon") => Narrowing::Polygon,
        Some("rectangle") => Narrowing::Rectangle,
        Some(other) => return Err(format!("it narrows to polygon or rectangle, not to `{other}`")),
    };
    let source = world.cells_to_look_through()?;
    let tolerance = SceneCells::usual_tolerance(&source.viewcells);
    let mut cells = SceneCells::new(source.graph.clone(), source.viewcells.clone(), tolerance)
        .map_err(|error| error.to_string())?;
    cells.sync(&world.scene);
    Ok(PortalCuller::new(cells).with_eye(PortalEye::new().with_narrowing(narrowing)))
}
