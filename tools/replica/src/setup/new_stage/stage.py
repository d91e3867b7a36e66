#!/usr/bin/env python3
"""{name}: a stage of REPLICA that classifies points by their height."""

import replica
from replica import Setting

GROUND = replica.CLASS_NAMES.index("ground")


class NewStage(replica.Stage):
    name, inputs, outputs = "{name}", ["submap"], ["class"]
    settings = {"ground_m": Setting(0.3, "Height above the lowest point up to which a point is ground, m.", within=(0.0, 100.0))}

    def step(self, inputs, outputs):
        for submap in inputs["submap"]:
            out = outputs.loan("class", like=submap)
            height_m = submap["z"] - submap["z"].min(initial=float("inf"))
            out["class_id"][height_m <= self.settings["ground_m"]] = GROUND
            out["score"][:] = 128
            outputs.publish(out)


if __name__ == "__main__":
    replica.run(NewStage)
