"""Speed and accuracy of the product: against peers, and against the bars of the project. No part of the package."""
