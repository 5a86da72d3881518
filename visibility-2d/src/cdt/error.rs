//! Errors of plans: walls that cannot be triangulated, and queries with invalid numbers.

use core::fmt;

/// Errors of making a [`Plan`](crate::cdt::Plan) and of queries.
#[derive(Clone, Copy, PartialEq, Debug)]
#[non_exhaustive]
pub enum PlanError {
    /// A coordinate of a point is NaN, infinite, or of a magnitude above 1e60.
    Coordinate {
        /// Index of the wall with the faulty point, or of the point among the points of a query, from 0.
        index: usize,
        /// First point with an invalid coordinate.
        point: [f64; 2],
    },
    /// There are more walls than [`Plan::LIMIT`](crate::cdt::Plan::LIMIT), the walls cross or overlap more
    /// often than [`Plan::new`](crate::cdt::Plan::new) allows, or the beams of a region enter more than 2^24
    /// triangles.
    TooMany {
        /// Number of walls given; or number of vertices, overlaps or entered triangles when the limit was
        /// reached; or, for a wall that is split without end, 2^24 plus the number of its splits.
        count: usize,
    },
    /// A wall's number is not below the number of walls of the plan.
    UnknownWall {
        /// Index of the wall in the query.
        wall: u32,
        /// Number of walls of the plan.
        walls: usize,
    },
    /// The objects belong to another plan, or no object has the given number.
    Objects,
    /// A visibility graph or an unseen region belongs to another plan, or a wall's opacity has changed since
    /// it was made. Or hiding places belong to another region, or the region has changed since.
    VisibilityGraph,
    /// A region or an object has no point, or a point outside the rectangle around the plan.
    Region,
    /// The axes of world space along which a plan lies are not two of 0, 1 and 2.
    Axes {
        /// The axes given, for the plan's x and y.
        axes: [usize; 2],
    },
    /// A height of a line of sight is NaN, infinite, or above 1e60 in absolute value.
    Heights,
}

impl fmt::Display for PlanError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::Coordinate { index, point: [x, y] } => {
                write!(
                    f,
                    "point ({x:?}, {y:?}) of number {index} has a coordinate that is no number up to 1e60"
                )
            }
            Self::TooMany { count } => write!(f, "{count} walls, crossings or overlaps are too many"),
            Self::UnknownWall { wall, walls } => {
                write!(f, "wall {wall} is unknown: the plan has {walls}, numbered from 0")
            }
            Self::Objects => write!(f, "the objects are of another plan, or none has that number"),
            Self::VisibilityGraph => {
                write!(f, "the graph, region or places are of another plan or region, or out of date")
            }
            Self::Region => {
                write!(f, "the region or object is empty, or not inside the rectangle around the plan")
            }
            Self::Axes { axes: [x, y] } => {
                write!(f, "a plan lies along two of the axes 0 to 2, not {x} and {y}")
            }
            Self::Heights => write!(f, "a height is no number up to 1e60"),
        }
    }
}

impl core::error::Error for PlanError {}
