"""A stage that breaks the rule that its setting names."""

import replica
from replica import Setting

KEPT = []


class Misbehaving(replica.Stage):
    name, inputs, outputs = "infer", ["submap"], ["class"]
    settings = {
        "fault": Setting("none", "What it does.", one_of=("none", "raise", "keep", "keep_loan", "outlive", "write", "configuration", "shape", "exit")),
        "limits": [1.0, 2.0],
        "n": Setting(3, at_least=1),
        "is_on": True,
    }

    @classmethod
    def check(cls, settings, context):
        if settings["n"] > 10 and settings["is_on"]:
            yield "n", "must be up to 10 while is_on"

    def setup(self):
        if self.settings["fault"] == "configuration":
            raise replica.ConfigurationError("the drive has no camera 7")

    def step(self, inputs, outputs):
        for submap in inputs["submap"]:
            getattr(self, self.settings["fault"], lambda *_: None)(submap, outputs)

    def keep(self, submap, outputs):
        KEPT.append(submap["x"][::100])

    def keep_loan(self, submap, outputs):
        out = outputs.loan("class", like=submap)
        classes = out["class_id"]
        classes[:] = 1
        outputs.publish(out)

    def outlive(self, submap, outputs):
        if KEPT:
            KEPT[0]["class_id"][:] = 1
        KEPT.append(outputs.loan("class", like=submap))
        outputs.publish(KEPT[-1])

    def write(self, submap, outputs):
        submap["x"][0] = 0.0

    def shape(self, submap, outputs):
        outputs.loan("class", len(submap) + (1 << 23))

    def exit(self, submap, outputs):
        raise SystemExit(0)


setattr(Misbehaving, "raise", lambda self, submap, outputs: 1 / 0)

if __name__ == "__main__":
    replica.run(Misbehaving)
