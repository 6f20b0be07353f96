# An order is an object that knows whether it is savory.
from dataclasses import dataclass


@dataclass
class Order:
    room: str
    snack: str

    @property
    def savory(self):
        return self.snack in ("ham sandwich", "beef jerky")


def task_program():
    desk = get_current_location()
    orders = []
    for room in sorted(get_all_rooms()):
        if "office" in room:
            go_to(room)
            if is_in_room("someone"):
                snack = ask("someone", "Please pick one of these snacks.", ["donut", "cupcake", "beef jerky", "ham sandwich"])
                orders.append(Order(room, snack))
    go_to(desk)
    savory = [order for order in orders if order.savory]
    say(f"Savory snacks chosen: {len(savory)}.")
