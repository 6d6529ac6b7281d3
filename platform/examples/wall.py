"""Instead of a camera: a patterned wall 2 m away that passes by."""
import numpy as np


def wall(passed_px):
    """A picture and its depth (mm) after so many pixels."""
    row, column = np.mgrid[0:480, 0:640].astype(np.uint32)
    cell = ((column + np.uint32(passed_px)) // 8 * np.uint32(2654435761)) ^ (row // 8 * np.uint32(2246822519))
    grey = ((cell ^ cell >> 15) * np.uint32(97)).astype(np.uint8)
    return grey, np.full((480, 640), 2000, np.uint16)
